#include "tileflight/capture/vehicle/collision.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace tileflight::vehicle {
namespace {

using geometry::Vec3;

constexpr int kFeelers = 26;
/// Every direction lies within 27.6 degrees of a probe ray (worst case between a face's, two edges' and a corner's); a
/// plane nearer than the radius is hit within radius / cos of that angle.
constexpr double kFeelerLength = 1.13;
/// Surfaces at a smaller grazing angle are left to the probe rays.
constexpr double kMinSine = 0.1;

std::array<Vec3, kFeelers> feeler_directions() {
  std::array<Vec3, kFeelers> directions;
  std::size_t n = 0;
  for (int x = -1; x <= 1; ++x)
    for (int y = -1; y <= 1; ++y)
      for (int z = -1; z <= 1; ++z)
        if (x != 0 || y != 0 || z != 0) directions[n++] = Vec3(x, y, z).normalized();
  return directions;
}

/// The hit's normal, oriented towards a point.
Vec3 normal_towards(const SurfaceHit& hit, const Vec3& point) {
  return hit.normal.dot(point - hit.point) < 0.0 ? Vec3(-hit.normal) : hit.normal;
}

/// Contact along the centre's path, extended by the reach of the sphere's front.
std::optional<Contact> contact_ahead(const ObstacleQuery& obstacles, const Vec3& from, const Vec3& to,
                                     double radius_m) {
  const double length_m = (to - from).norm();
  if (length_m <= 0.0) return std::nullopt;
  const Vec3 direction = (to - from) / length_m;
  const auto hit = obstacles(from, to + direction * (radius_m / kMinSine));
  if (!hit) return std::nullopt;
  const Vec3 normal = normal_towards(*hit, from);
  const double sine = std::max(-normal.dot(direction), kMinSine);
  const double way_m = (hit->point - from).norm() - radius_m / sine;
  if (way_m >= length_m) return std::nullopt;
  return Contact{from + std::max(0.0, way_m) * direction, hit->point, normal, hit->object};
}

/// The nearest surface that a sphere at rest intersects, with the centre moved out of it.
std::optional<Contact> contact_around(const ObstacleQuery& obstacles, const Vec3& center, double radius_m) {
  static const std::array<Vec3, kFeelers> kDirections = feeler_directions();
  std::optional<Contact> deepest;
  double least_m = radius_m;
  for (const Vec3& direction : kDirections) {
    const auto hit = obstacles(center, center + direction * (kFeelerLength * radius_m));
    if (!hit) continue;
    const Vec3 normal = normal_towards(*hit, center);
    const double distance_m = normal.dot(center - hit->point);
    if (distance_m >= least_m) continue;
    least_m = distance_m;
    deepest = Contact{center + (radius_m - distance_m) * normal, hit->point, normal, hit->object};
  }
  return deepest;
}

bool is_separating(const Contact& contact, const Vec3& way) { return contact.normal.dot(way) >= 0.0; }

}  // namespace

std::optional<Contact> first_contact(const ObstacleQuery& obstacles, const Vec3& from, const Vec3& to,
                                     double radius_m) {
  const Vec3 way = to - from;
  auto ahead = contact_ahead(obstacles, from, to, radius_m);
  if (ahead && is_separating(*ahead, way)) ahead.reset();
  const Vec3 end = ahead ? ahead->center : to;
  const int parts = std::max(1, static_cast<int>(std::ceil((end - from).norm() / radius_m)));
  for (int part = 1; part <= parts; ++part) {
    const auto beside = contact_around(obstacles, from + (end - from) * (static_cast<double>(part) / parts), radius_m);
    if (beside && !is_separating(*beside, way)) return beside;
  }
  return ahead;
}

bool touches(const ObstacleQuery& obstacles, const Vec3& center, double radius_m) {
  return contact_around(obstacles, center, radius_m).has_value();
}

Vec3 bounce_velocity(const Vec3& velocity_m_s, const Vec3& normal, const BounceOptions& options) {
  const double into_m_s = -velocity_m_s.dot(normal);
  if (into_m_s <= 0.0) return velocity_m_s;
  const double restitution = into_m_s < options.min_bounce_speed_m_s ? 0.0 : options.restitution;
  const Vec3 along = velocity_m_s + into_m_s * normal;
  const double along_m_s = along.norm();
  const double braked_m_s = std::min(along_m_s, options.friction * (1.0 + restitution) * into_m_s);
  const Vec3 left = along_m_s > 0.0 ? Vec3(along * (1.0 - braked_m_s / along_m_s)) : Vec3(Vec3::Zero());
  return left + restitution * into_m_s * normal;
}

}  // namespace tileflight::vehicle
