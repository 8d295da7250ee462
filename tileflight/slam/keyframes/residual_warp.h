#pragma once

// A residual in two steps: where the patch falls, then what is there.

#include "tileflight/slam/keyframes/residual.h"

namespace tileflight::keyframes {

/// Where a patch falls in a target. Most of a residual's time is spent on waiting for the target's grey values;
/// warp_residual() asks for them, so that they are there when a residual that was warped some time ago is evaluated.
struct ResidualWarp {
  bool inside = false;
  WarpedPatch warped;
};

void warp_residual(const Lens& lens, const PyramidLevel& target, const Patch& patch, float rho,
                   const HostTargetPrecalc& frame, ResidualWarp& out);
/// As evaluate_residual() of residual.h, with the same bits.
ResidualValue evaluate_residual(const ResidualWarp& warp, const Lens& lens, const PyramidLevel& target,
                                const Patch& patch, float rho, const HostTargetPrecalc& frame, float huber,
                                Linearization* linearization, const Lens* lens_linear = nullptr);

}  // namespace tileflight::keyframes
