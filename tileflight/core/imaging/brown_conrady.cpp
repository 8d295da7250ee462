#include "tileflight/core/imaging/brown_conrady.h"

#include <algorithm>

#include "tileflight/core/imaging/plane_distortion.h"

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
