#include "tileflight/core/imaging/sphere_lenses.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "tileflight/core/imaging/brown_conrady.h"

namespace tileflight::imaging::sphere_lenses {

namespace {

using geometry::Vec2;
using geometry::Vec3;
constexpr double kPi = std::numbers::pi;

/// sin phi / (alpha + (1 - alpha) cos phi) stops increasing (alpha > 1/2) or becomes infinite at cos phi = -w; returns
/// w.
double widest_cosine(double alpha) { return alpha > 0.5 ? (1.0 - alpha) / alpha : alpha / (1.0 - alpha); }

/// The angle theta for which cos phi = -w, or at which phi itself stops increasing (1 + xi cos theta = 0, xi > 1).
double theta_at(double xi, double w) {
  const double fold = xi > 1.0 ? -1.0 / xi : -1.0;
  const double root = 1.0 - xi * xi * (1.0 - w * w);
  if (root < 0.0) return std::acos(fold);
  const double cosine = -xi * (1.0 - w * w) - w * std::sqrt(root);
  return std::acos(std::clamp(std::max(cosine, fold), -1.0, 1.0));
}

/// z coordinate of the point on the second sphere (or ellipsoid) at squared radius r2 in the plane of m: (1 - alpha^2
/// r2) / (alpha sqrt(1 - (2 alpha - 1) r2) + 1 - alpha).
std::optional<double> height_at(double alpha, double r2) {
  const double root = 1.0 - (2.0 * alpha - 1.0) * r2;
  if (!(root >= 0.0)) return std::nullopt;
  return (1.0 - alpha * alpha * r2) / (alpha * std::sqrt(root) + 1.0 - alpha);
}

/// Converts the direction (m, mz) at the centre shifted by xi to the ray at the sphere's own centre.
std::optional<Vec3> through_sphere(double xi, const Vec2& m, double mz) {
  const double n2 = mz * mz + m.squaredNorm();
  const double root = mz * mz + (1.0 - xi * xi) * m.squaredNorm();
  if (!(root >= 0.0)) return std::nullopt;
  const double length = (mz * xi + std::sqrt(root)) / n2;
  return Vec3(length * m.x(), length * m.y(), length * mz - xi);
}

}  // namespace

/// Usenko, Demmel, Cremers, "The double sphere camera model", 3DV 2018, eq. 40 to 42.
Denominator denominator(const DoubleSphere& m, const Vec3& p) {
  const double d1 = p.norm();
  const double shifted = m.xi * d1 + p.z();
  const Vec3 shifted_by_point = m.xi / d1 * p + Vec3::UnitZ();
  const double d2 = std::sqrt(p.x() * p.x() + p.y() * p.y() + shifted * shifted);
  const Vec3 d2_by_point = (Vec3(p.x(), p.y(), 0.0) + shifted * shifted_by_point) / d2;
  return {m.alpha * d2 + (1.0 - m.alpha) * shifted, m.alpha * d2_by_point + (1.0 - m.alpha) * shifted_by_point};
}

/// Mei and Rives, "Single view point omnidirectional camera calibration from planar grids", ICRA 2007, section III.
Denominator denominator(const UnifiedModel& m, const Vec3& p) {
  const double d = p.norm();
  return {m.xi * d + p.z(), m.xi / d * p + Vec3::UnitZ()};
}

/// Khomutenko, Garcia, Martinet, "An enhanced unified camera model", RA-L 2016, eq. 6.
Denominator denominator(const ExtendedUnifiedModel& m, const Vec3& p) {
  const double d = std::sqrt(m.beta * (p.x() * p.x() + p.y() * p.y()) + p.z() * p.z());
  const Vec3 d_by_point = Vec3(m.beta * p.x(), m.beta * p.y(), p.z()) / d;
  return {m.alpha * d + (1.0 - m.alpha) * p.z(), m.alpha * d_by_point + (1.0 - m.alpha) * Vec3::UnitZ()};
}

/// Double sphere unprojection: the same paper, eq. 46 to 50.
std::optional<Vec3> unproject(const DoubleSphere& m, const Vec2& normalized) {
  const std::optional<double> mz = height_at(m.alpha, normalized.squaredNorm());
  if (!mz) return std::nullopt;
  return through_sphere(m.xi, normalized, *mz);
}

std::optional<Vec3> unproject(const UnifiedModel& m, const Vec2& normalized) {
  return through_sphere(m.xi, normalized, 1.0);
}

std::optional<Vec3> unproject(const ExtendedUnifiedModel& m, const Vec2& normalized) {
  const std::optional<double> mz = height_at(m.alpha, m.beta * normalized.squaredNorm());
  if (!mz) return std::nullopt;
  return Vec3(normalized.x(), normalized.y(), *mz);
}

double max_theta_rad(const DoubleSphere& m) { return theta_at(m.xi, widest_cosine(m.alpha)); }

double max_theta_rad(const UnifiedModel& m) {
  const double sphere = theta_at(m.xi, 0.0);
  const std::optional<double> radius = brown_conrady::max_valid_radius(m.d);
  if (!radius) return sphere;
  const std::optional<Vec3> ray = unproject(m, Vec2(*radius, 0.0));
  return ray ? std::min(sphere, std::atan2(ray->x(), ray->z())) : sphere;
}

double max_theta_rad(const ExtendedUnifiedModel& m) {
  const double phi = std::acos(-widest_cosine(m.alpha));
  return phi >= kPi ? kPi : std::atan2(std::sin(phi), std::sqrt(m.beta) * std::cos(phi));
}

}  // namespace tileflight::imaging::sphere_lenses
