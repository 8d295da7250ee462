#pragma once

// Depth search for an immature point along its epipolar curve: DSO, section 3.2, on the sphere. In the target the point
// lies on the great circle from R r (rho = 0) towards t (rho -> infinity); phi is the angle along it, psi the angle
// between both:
//   tan(phi) = rho |t| sin(psi) / (1 + rho |t| cos(psi)),      rho = sin(phi) / (|t| sin(psi - phi)).

#include "tileflight/slam/keyframes/keyframe.h"
#include "tileflight/slam/keyframes/options.h"

namespace tileflight::mapping {

/// Updates the point's inverse-distance interval from one more image with known pose and brightness.
void trace_point(const keyframes::Lens& lens, const keyframes::PyramidLevel& target,
                 const keyframes::PairTransform& pair, const keyframes::TracingOptions& options, float huber,
                 keyframes::ImmaturePoint& point);

/// Calls trace_point() for many points, in parallel.
void trace_points(const keyframes::Lens& lens, const keyframes::PyramidLevel& target,
                  const keyframes::PairTransform& pair, const keyframes::TracingOptions& options, float huber,
                  std::vector<keyframes::ImmaturePoint>& points);

}  // namespace tileflight::mapping
