#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

namespace tileflight::flight_path {

/// Evenly spaced knots over a time interval. A cubic spline over them has three more control points than segments;
/// control points i to i + 3 determine segment i.
struct UniformKnots {
  double start_s = 0.0;
  double spacing_s = 1.0;
  std::size_t segments = 1;

  double end_s() const { return start_s + spacing_s * static_cast<double>(segments); }
  std::size_t control_count() const { return segments + 3; }

  /// The segment that contains a time, and the position u in it (0 to 1). Times outside the knots are clamped.
  struct KnotSpan {
    std::size_t segment;
    double u;
  };
  KnotSpan find_span(double time_s) const {
    const double at = std::clamp((time_s - start_s) / spacing_s, 0.0, static_cast<double>(segments));
    const std::size_t segment = std::min(static_cast<std::size_t>(at), segments - 1);
    return {segment, at - static_cast<double>(segment)};
  }
  /// The time at which control point i has its greatest weight.
  double control_time_s(std::size_t i) const { return start_s + spacing_s * (static_cast<double>(i) - 1.0); }
};

/// Weights of a segment's four control points, and of the three differences between them.
using Weights4 = std::array<double, 4>;
using Weights3 = std::array<double, 3>;

/// Weights of the uniform cubic B-spline (de Boor, A Practical Guide to Splines, chapter X) at u in a segment, and
/// their derivatives by u.
inline Weights4 basis(double u) {
  const double v = 1.0 - u;
  return {v * v * v / 6.0, (4.0 - 6.0 * u * u + 3.0 * u * u * u) / 6.0, (4.0 - 6.0 * v * v + 3.0 * v * v * v) / 6.0,
          u * u * u / 6.0};
}
inline Weights4 basis_derivative(double u) {
  const double v = 1.0 - u;
  return {-v * v / 2.0, (3.0 * u * u - 4.0 * u) / 2.0, (4.0 * v - 3.0 * v * v) / 2.0, u * u / 2.0};
}
inline Weights4 basis_second_derivative(double u) { return {1.0 - u, 3.0 * u - 2.0, 1.0 - 3.0 * u, u}; }

/// Cumulative weights of the differences between consecutive control points (Kim, Kim, Shin 1995, (4)): the sums of the
/// weights from the second, third and fourth control point on.
inline Weights3 cumulative_weights(const Weights4& weights) {
  return {weights[1] + weights[2] + weights[3], weights[2] + weights[3], weights[3]};
}

/// Uniform cubic B-spline in D dimensions, twice continuously differentiable. Derivatives are by time.
template <int D>
struct BSpline {
  using Vector = Eigen::Matrix<double, D, 1>;

  UniformKnots knots;
  std::vector<Vector> controls;  ///< size: knots.control_count()

  Vector value(double time_s) const {
    const auto [segment, u] = knots.find_span(time_s);
    return sum(segment, basis(u));
  }
  Vector first_derivative(double time_s) const {
    const auto [segment, u] = knots.find_span(time_s);
    return sum(segment, basis_derivative(u)) / knots.spacing_s;
  }
  Vector second_derivative(double time_s) const {
    const auto [segment, u] = knots.find_span(time_s);
    return sum(segment, basis_second_derivative(u)) / (knots.spacing_s * knots.spacing_s);
  }

 private:
  Vector sum(std::size_t segment, const Weights4& weights) const {
    Vector result = Vector::Zero();
    for (std::size_t k = 0; k < 4; ++k) result += weights[k] * controls[segment + k];
    return result;
  }
};

}  // namespace tileflight::flight_path
