#include "tileflight/core/imaging/lens_distortion.h"

#include <algorithm>
#include <cmath>
#include <vector>

namespace tileflight::imaging {

namespace {

std::vector<double> derivative(std::span<const double> c) {
  std::vector<double> d;
  for (std::size_t i = 1; i < c.size(); ++i) d.push_back(static_cast<double>(i) * c[i]);
  return d;
}

/// The root between two arguments whose values have opposite signs (or one is zero), to full precision.
double bisect(std::span<const double> c, double lower, double upper) {
  const bool lower_is_positive = evaluate_polynomial(c, lower) > 0.0;
  for (;;) {
    const double middle = 0.5 * (lower + upper);
    if (middle <= lower || middle >= upper) return upper;
    ((evaluate_polynomial(c, middle) > 0.0) == lower_is_positive ? lower : upper) = middle;
  }
}

/// All sign changes in (0, upper], ascending: between neighbouring roots of the derivative the polynomial is monotone.
std::vector<double> sign_changes(std::span<const double> c, double upper) {
  if (c.size() <= 1) return {};
  std::vector<double> ends = sign_changes(derivative(c), upper);
  ends.push_back(upper);
  std::vector<double> roots;
  double lower = 0.0;
  for (const double end : ends) {
    if ((evaluate_polynomial(c, lower) > 0.0) != (evaluate_polynomial(c, end) > 0.0))
      roots.push_back(bisect(c, lower, end));
    lower = end;
  }
  return roots;
}

}  // namespace

double evaluate_polynomial(std::span<const double> c, double x) {
  double value = 0.0;
  for (std::size_t i = c.size(); i-- > 0;) value = value * x + c[i];
  return value;
}

std::optional<double> first_nonpositive(std::span<const double> c, double upper) {
  const std::vector<double> roots = sign_changes(c, upper);
  if (roots.empty()) return std::nullopt;
  return roots.front();
}

}  // namespace tileflight::imaging

namespace tileflight::imaging::brown_conrady {

namespace {

using geometry::Vec2;

/// Inverse of the radial part alone; nullopt beyond the radius at which it stops increasing.
std::optional<Vec2> undistort_radial(const std::array<double, 4>& d, std::optional<double> max_radius,
                                     const Vec2& target) {
  const auto value = [&](double r) { return r * (1.0 + r * r * (d[0] + r * r * d[1])); };
  const auto slope = [&](double r) { return 1.0 + r * r * (3.0 * d[0] + r * r * 5.0 * d[1]); };
  const double wanted = target.norm();
  if (wanted == 0.0) return target;
  double upper = max_radius.value_or(std::max(1.0, wanted));
  if (max_radius && wanted > value(upper)) return std::nullopt;
  while (value(upper) < wanted) upper *= 2.0;  // terminates, because the function is unbounded
  return target * (solve_increasing(wanted, wanted, 0.0, upper, value, slope) / wanted);
}

}  // namespace

DistortedPoint distort(const std::array<double, 4>& d, const Vec2& m) {
  const auto [k1, k2, p1, p2] = d;
  const double x = m.x();
  const double y = m.y();
  const double r2 = x * x + y * y;
  const double radial = 1.0 + r2 * (k1 + r2 * k2);
  const double slope = 2.0 * (k1 + 2.0 * k2 * r2);  // d radial / d x = slope * x
  DistortedPoint out;
  out.point = {x * radial + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x),
               y * radial + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y};
  const double mixed = slope * x * y + 2.0 * p1 * x + 2.0 * p2 * y;
  out.jacobian << radial + slope * x * x + 2.0 * p1 * y + 6.0 * p2 * x, mixed,  //
      mixed, radial + slope * y * y + 6.0 * p1 * y + 2.0 * p2 * x;
  return out;
}

std::optional<double> max_valid_radius(const std::array<double, 4>& d) {
  constexpr double kLargestSquaredRadius = 1e12;                   // practically infinite
  const std::array<double, 3> slope{1.0, 3.0 * d[0], 5.0 * d[1]};  // in r^2
  const std::optional<double> r2 = first_nonpositive(slope, kLargestSquaredRadius);
  if (!r2) return std::nullopt;
  return std::sqrt(*r2);
}

std::optional<Vec2> undistort(const std::array<double, 4>& d, std::optional<double> max_radius, const Vec2& target) {
  if (d == std::array<double, 4>{}) return target;
  const std::optional<Vec2> start = undistort_radial(d, max_radius, target);
  const bool radial_only = d[2] == 0.0 && d[3] == 0.0;
  const std::optional<Vec2> m =
      radial_only ? start
                  : undistort_from([&d](const Vec2& at) { return distort(d, at); }, start.value_or(target), target);
  if (m && max_radius && m->norm() > *max_radius) return std::nullopt;
  return m;
}

}  // namespace tileflight::imaging::brown_conrady

namespace tileflight::imaging::rational {

namespace {

using geometry::Vec2;

/// N/D and its derivative by r^2.
struct Ratio {
  double value = 1.0;
  double slope = 0.0;
};

Ratio ratio(const Coefficients& d, double r2) {
  const auto& [k1, k2, p1, p2, k3, k4, k5, k6, s1, s2, s3, s4] = d;
  const double above = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3));
  const double below = 1.0 + r2 * (k4 + r2 * (k5 + r2 * k6));
  const double d_above = k1 + r2 * (2.0 * k2 + r2 * 3.0 * k3);
  const double d_below = k4 + r2 * (2.0 * k5 + r2 * 3.0 * k6);
  return {above / below, (d_above * below - above * d_below) / (below * below)};
}

/// Inverse of the radial part alone; nullopt beyond the radius at which it stops increasing.
std::optional<Vec2> undistort_rational(const Coefficients& d, double max_radius, const Vec2& target) {
  const auto value = [&d](double r) { return r * ratio(d, r * r).value; };
  const auto slope = [&d](double r) {
    const Ratio at = ratio(d, r * r);
    return at.value + 2.0 * r * r * at.slope;
  };
  const double wanted = target.norm();
  if (wanted == 0.0) return target;
  if (!(wanted <= value(max_radius))) return std::nullopt;
  double upper = std::min(max_radius, std::max(1.0, wanted));
  while (value(upper) < wanted) upper = std::min(2.0 * upper, max_radius);
  return target * (solve_increasing(wanted, wanted, 0.0, upper, value, slope) / wanted);
}

}  // namespace

DistortedPoint distort(const Coefficients& d, const Vec2& m) {
  const auto& [k1, k2, p1, p2, k3, k4, k5, k6, s1, s2, s3, s4] = d;
  const double x = m.x();
  const double y = m.y();
  const double r2 = x * x + y * y;
  const Ratio radial = ratio(d, r2);
  const double slope = 2.0 * radial.slope;  // d radial / d x = slope * x
  DistortedPoint out;
  out.point = {x * radial.value + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x) + r2 * (s1 + r2 * s2),
               y * radial.value + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y + r2 * (s3 + r2 * s4)};
  const double prism_x = 2.0 * (s1 + 2.0 * r2 * s2), prism_y = 2.0 * (s3 + 2.0 * r2 * s4);  // times x, y by x, y
  const double mixed = slope * x * y + 2.0 * p1 * x + 2.0 * p2 * y;
  out.jacobian << radial.value + slope * x * x + 2.0 * p1 * y + 6.0 * p2 * x + prism_x * x, mixed + prism_x * y,
      mixed + prism_y * x, radial.value + slope * y * y + 6.0 * p1 * y + 2.0 * p2 * x + prism_y * y;
  return out;
}

bool is_radial(const Coefficients& d) {
  return d[2] == 0.0 && d[3] == 0.0 && std::all_of(d.begin() + 8, d.end(), [](double s) { return s == 0.0; });
}

double max_valid_radius(const Coefficients& d) {
  constexpr double kLargestRadius = 1e6;
  const std::array<double, 4> above{1.0, d[0], d[1], d[4]}, below{1.0, d[5], d[6], d[7]};
  // d(r N/D)/dr = ((N + 2 t N') D - 2 t N D') / D^2 with t = r^2.
  std::array<double, 7> slope{};
  for (std::size_t i = 0; i < above.size(); ++i) {
    for (std::size_t j = 0; j < below.size(); ++j)
      slope[i + j] += (1.0 + 2.0 * static_cast<double>(i) - 2.0 * static_cast<double>(j)) * above[i] * below[j];
  }
  const double squared = kLargestRadius * kLargestRadius;
  return std::sqrt(std::min(first_nonpositive(slope, squared).value_or(squared),
                            first_nonpositive(below, squared).value_or(squared)));
}

std::optional<Vec2> undistort(const Coefficients& d, double max_radius, const Vec2& target) {
  const std::optional<Vec2> start = undistort_rational(d, max_radius, target);
  const auto distorted = [&d](const Vec2& at) { return distort(d, at); };
  const std::optional<Vec2> m = is_radial(d) ? start : undistort_from(distorted, start.value_or(target), target);
  if (m && m->norm() > max_radius) return std::nullopt;
  return m;
}

}  // namespace tileflight::imaging::rational
