#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <span>

#include "tileflight/core/geometry/transform.h"

namespace tileflight::imaging {

/// Evaluates c[0] + c[1] x + c[2] x^2 + ... (Horner).
double evaluate_polynomial(std::span<const double> c, double x);

/// Returns the smallest x in (0, upper] at which the polynomial is zero or negative; its value at 0 must be positive.
/// nullopt if it stays positive. Searches between the roots of the derivative, so that no sign change is missed.
std::optional<double> first_nonpositive(std::span<const double> c, double upper);

inline constexpr double kNewtonTolerance =
    1e-14;                                  ///< relative step to stop at: below 1e-9 px at any focal length in use
inline constexpr int kMaxNewtonSteps = 60;  ///< bisection alone needs about 52; Newton takes 3 to 6

/// Solves value(t) = target for an increasing function on [lower, upper] by Newton's method inside a shrinking bracket.
template <class Value, class Slope>
double solve_increasing(double target, double start, double lower, double upper, const Value& value,
                        const Slope& slope) {
  constexpr double kLastStep = 1e-9;
  double t = std::clamp(start, lower, upper);
  for (int i = 0; i < kMaxNewtonSteps; ++i) {
    const double excess = value(t) - target;
    (excess > 0.0 ? upper : lower) = t;
    double next = t - excess / slope(t);
    const bool newton = next >= lower && next <= upper;
    if (!newton) next = 0.5 * (lower + upper);
    const double step = std::abs(next - t);
    t = next;
    // Newton's error is squared by each step: after a step of 1e-9 the remaining value - target is below rounding.
    if (step <= (newton ? kLastStep : kNewtonTolerance) * (1.0 + std::abs(t))) break;
  }
  return t;
}

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

/// Radial and tangential distortion in normalised coordinates (Brown 1966; OpenCV's first four: k1 k2 p1 p2).
namespace tileflight::imaging::brown_conrady {

/// Computes x (1 + k1 r^2 + k2 r^4) + 2 p1 x y + p2 (r^2 + 2 x^2); y likewise, with p1 and p2 exchanged.
DistortedPoint distort(const std::array<double, 4>& d, const geometry::Vec2& m);

/// Returns the radius at which r (1 + k1 r^2 + k2 r^4) stops increasing; nullopt if it always increases.
std::optional<double> max_valid_radius(const std::array<double, 4>& d);

/// Inverse of distort(), with a radius of at most `max_radius`; nullopt if there is no solution.
std::optional<geometry::Vec2> undistort(const std::array<double, 4>& d, std::optional<double> max_radius,
                                        const geometry::Vec2& target);

}  // namespace tileflight::imaging::brown_conrady

/// OpenCV's rational and thin-prism distortion (docs.opencv.org, "Camera Calibration and 3D Reconstruction"), without
/// the tilted sensor: coefficients k1 k2 p1 p2 k3 k4 k5 k6 s1 s2 s3 s4.
namespace tileflight::imaging::rational {

using Coefficients = std::array<double, 12>;

/// Computes x N/D + 2 p1 x y + p2 (r^2 + 2 x^2) + s1 r^2 + s2 r^4, y N/D + p1 (r^2 + 2 y^2) + 2 p2 x y + s3 r^2 + s4
/// r^4, with N = 1 + k1 r^2 + k2 r^4 + k3 r^6 and D = 1 + k4 r^2 + k5 r^4 + k6 r^6.
DistortedPoint distort(const Coefficients& d, const geometry::Vec2& m);

/// Whether the distortion is purely radial, so that the lens is symmetric about its axis.
bool is_radial(const Coefficients& d);

/// Returns the radius at which r N/D stops increasing or D is zero; 1e6, practically infinite, if it increases beyond.
double max_valid_radius(const Coefficients& d);

/// Inverse of distort(), with a radius of at most `max_radius`; nullopt if there is no solution.
std::optional<geometry::Vec2> undistort(const Coefficients& d, double max_radius, const geometry::Vec2& target);

}  // namespace tileflight::imaging::rational
