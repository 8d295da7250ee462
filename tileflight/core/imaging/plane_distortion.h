#pragma once

#include <optional>

#include "tileflight/core/geometry/transform.h"
#include "tileflight/core/imaging/newton.h"

namespace tileflight::imaging {

/// Distorted normalised coordinates (x/z, y/z) and their derivative.
struct DistortedPoint {
  geometry::Vec2 point;
  Eigen::Matrix2d jacobian;  ///< derivative by the undistorted coordinates
};

/// Inverts `distort` (Vec2 to DistortedPoint) for `target`, starting at `m`, by two-dimensional Newton steps with step
/// halving; nullopt if it does not converge.
template <class Distort>
std::optional<geometry::Vec2> undistort_from(const Distort& distort, geometry::Vec2 m, const geometry::Vec2& target) {
  DistortedPoint at = distort(m);
  for (int i = 0; i < kMaxNewtonSteps; ++i) {
    if (!(at.jacobian.determinant() > 0.0)) return std::nullopt;
    geometry::Vec2 step = at.jacobian.inverse() * (target - at.point);
    const double error = (target - at.point).norm();
    if (error <= kNewtonTolerance * (1.0 + target.norm())) return m;
    DistortedPoint next = distort(m + step);
    while ((target - next.point).norm() > error && step.norm() > kNewtonTolerance * (1.0 + m.norm())) {
      step *= 0.5;
      next = distort(m + step);
    }
    m += step;
    at = next;
    if (step.norm() <= kNewtonTolerance * (1.0 + m.norm())) break;
  }
  constexpr double kAccepted = 1e-12;  // rounding may keep the residual just above the stopping threshold
  if ((target - at.point).norm() > kAccepted * (1.0 + target.norm())) return std::nullopt;
  return m;
}

}  // namespace tileflight::imaging
