#pragma once

#include <span>

#include "tileflight/capture/flight_path/b_spline.h"
#include "tileflight/capture/flight_path/rotation_spline.h"

namespace tileflight::flight_path {

/// Least-squares fit of a spline to positions at their times (banded normal equations: de Boor, chapter XIV). Across
/// knots without data, control points minimize bending. `times_s` is strictly increasing and has as many entries as
/// `positions_m`. Sums are formed in a fixed order, so the result does not depend on the number of threads.
BSpline<3> fit_positions(std::span<const double> times_s, std::span<const geometry::Vec3> positions_m,
                         const UniformKnots& knots);

/// Least-squares fit of a rotation spline: Gauss–Newton on the residual angles, starting from the given rotations.
RotationSpline fit_rotations(std::span<const double> times_s, std::span<const Eigen::Quaterniond> rotations,
                             const UniformKnots& knots);

}  // namespace tileflight::flight_path
