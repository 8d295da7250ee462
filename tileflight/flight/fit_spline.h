#pragma once

#include <span>

#include "tileflight/flight/b_spline.h"
#include "tileflight/flight/rotation_spline.h"

namespace tileflight::flight {

/// The spline that is nearest to the points at their times by least squares (banded normal equations: de Boor, chapter
/// XIV). Where there is no point for several knots, control points lie so that they bend least. `times_s` strictly
/// increase, as many as points; sums are in order, so that results do not depend on threads.
BSpline<3> fit_positions(std::span<const double> times_s, std::span<const geometry::Vec3> positions_m,
                         const UniformKnots& knots);

/// The same for rotations, by the angles of what is left; Gauss–Newton from the given rotations.
RotationSpline fit_rotations(std::span<const double> times_s, std::span<const Eigen::Quaterniond> rotations,
                             const UniformKnots& knots);

}  // namespace tileflight::flight
