#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cassert>
#include <utility>
#include <vector>

namespace tileflight::flight_path {

/// Natural cubic spline in D dimensions: interpolates every point, is twice continuously differentiable, and its second
/// derivative is zero at both ends. de Boor, A Practical Guide to Splines, chapter IV.
template <int D>
class CubicSpline {
 public:
  using Vector = Eigen::Matrix<double, D, 1>;

  CubicSpline() = default;

  /// `knots` are strictly increasing, at least two, and as many as `values`.
  CubicSpline(std::vector<double> knots, std::vector<Vector> values)
      : knots_(std::move(knots)), values_(std::move(values)) {
    assert(knots_.size() >= 2 && knots_.size() == values_.size());
    solve_second_derivatives();
  }

  double start() const { return knots_.front(); }
  double end() const { return knots_.back(); }
  const std::vector<double>& knots() const { return knots_; }

  Vector value(double u) const {
    const KnotSpan p = find_span(u);
    return p.a * values_[p.i] + p.b * values_[p.i + 1] +
           p.h * p.h / 6.0 * ((p.a * p.a * p.a - p.a) * second_[p.i] + (p.b * p.b * p.b - p.b) * second_[p.i + 1]);
  }
  Vector first_derivative(double u) const {
    const KnotSpan p = find_span(u);
    return (values_[p.i + 1] - values_[p.i]) / p.h +
           p.h / 6.0 * ((3.0 * p.b * p.b - 1.0) * second_[p.i + 1] - (3.0 * p.a * p.a - 1.0) * second_[p.i]);
  }
  Vector second_derivative(double u) const {
    const KnotSpan p = find_span(u);
    return p.a * second_[p.i] + p.b * second_[p.i + 1];
  }

 private:
  /// Segment i, its length h, and the weights a and b of its ends at u. u is clamped to the knots.
  struct KnotSpan {
    std::size_t i;
    double h, a, b;
  };

  KnotSpan find_span(double u) const {
    const double inside = std::clamp(u, start(), end());
    const auto above = std::upper_bound(knots_.begin() + 1, knots_.end() - 1, inside);
    const auto i = static_cast<std::size_t>(above - knots_.begin()) - 1;
    const double h = knots_[i + 1] - knots_[i];
    const double b = (inside - knots_[i]) / h;
    return {i, h, 1.0 - b, b};
  }

  /// Solves h[i-1] m[i-1] + 2 (h[i-1] + h[i]) m[i] + h[i] m[i+1] = 6 (slope[i] - slope[i-1]) with m = 0 at both ends by
  /// Thomas's algorithm.
  void solve_second_derivatives() {
    const std::size_t n = knots_.size();
    second_.assign(n, Vector::Zero());
    std::vector<double> upper(n, 0.0);
    for (std::size_t i = 1; i + 1 < n; ++i) {
      const double before = knots_[i] - knots_[i - 1], after = knots_[i + 1] - knots_[i];
      const Vector bend = 6.0 * ((values_[i + 1] - values_[i]) / after - (values_[i] - values_[i - 1]) / before);
      const double pivot = 2.0 * (before + after) - before * upper[i - 1];
      upper[i] = after / pivot;
      second_[i] = (bend - before * second_[i - 1]) / pivot;
    }
    for (std::size_t i = n - 1; i-- > 1;) second_[i] -= upper[i] * second_[i + 1];
  }

  std::vector<double> knots_;
  std::vector<Vector> values_;
  std::vector<Vector> second_;  ///< second derivatives at the knots
};

}  // namespace tileflight::flight_path
