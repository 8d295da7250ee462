#pragma once

// A first guess of scale, gravity, velocities and the gyroscope's bias, in closed form, for a given offset of the
// clocks.

#include <optional>

#include "tileflight/slam/inertial/visual_inertial_problem.h"

namespace tileflight::inertial {

/// Computes the first guess after Mur-Artal and Tardós, "Visual-Inertial Monocular SLAM With Map Reuse", IEEE RA-L
/// 2(2), 2017: the gyroscope's bias from the rotations (IV-A), then scale and gravity from triples of keyframes,
/// without velocities and with no accelerometer's bias (IV-B, (12)). The keyframes of a triple are at least `spacing_s`
/// apart, since the positions' errors count less the longer the time. nullopt if the samples cover fewer than two such
/// triples (one, of a metric map), or if no positive scale fits.
std::optional<VisualInertialState> inertial_start(const VisualInertialProblem& problem, double time_offset_s,
                                                  double spacing_s = 0.7);

}  // namespace tileflight::inertial
