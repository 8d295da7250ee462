#pragma once

#include <optional>

#include "tileflight/geometry/transform.h"
#include "tileflight/imaging/newton.h"

namespace tileflight::imaging {

/// What a distortion makes of normalised coordinates (x/z, y/z).
struct Distorted {
  geometry::Vec2 m;
  Eigen::Matrix2d d_m;  ///< by the undistorted coordinates
};

/// The coordinates that `distort` (Vec2 to Distorted) takes to `target`, by Newton in two dimensions with step halving;
/// nullopt where it does not arrive from `m`.
template <class Distort>
std::optional<geometry::Vec2> undistort_from(const Distort& distort, geometry::Vec2 m, const geometry::Vec2& target) {
  Distorted at = distort(m);
  for (int i = 0; i < kMaxNewtonSteps; ++i) {
    if (!(at.d_m.determinant() > 0.0)) return std::nullopt;
    geometry::Vec2 step = at.d_m.inverse() * (target - at.m);
    const double error = (target - at.m).norm();
    if (error <= kNewtonTolerance * (1.0 + target.norm())) return m;
    Distorted next = distort(m + step);
    while ((target - next.m).norm() > error && step.norm() > kNewtonTolerance * (1.0 + m.norm())) {
      step *= 0.5;
      next = distort(m + step);
    }
    m += step;
    at = next;
    if (step.norm() <= kNewtonTolerance * (1.0 + m.norm())) break;
  }
  constexpr double kAccepted = 1e-12;  // rounding may keep the residual just above the stopping threshold
  if ((target - at.m).norm() > kAccepted * (1.0 + target.norm())) return std::nullopt;
  return m;
}

}  // namespace tileflight::imaging
