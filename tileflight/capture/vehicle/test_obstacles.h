#pragma once

#include <algorithm>
#include <cmath>

#include "tileflight/capture/vehicle/collision.h"

namespace tileflight::vehicle::test_support {

/// The plane normal . p = offset.
inline ObstacleQuery plane(const geometry::Vec3& normal, double offset) {
  return [=](const geometry::Vec3& from, const geometry::Vec3& to) -> std::optional<SurfaceHit> {
    const double a = normal.dot(from) - offset, b = normal.dot(to) - offset;
    if (a * b > 0.0 || a == b) return std::nullopt;
    return SurfaceHit{from + (to - from) * (a / (a - b)), normal};
  };
}

/// A horizontal plane at a height.
inline ObstacleQuery level_ground(double height_m) { return plane(geometry::Vec3::UnitZ(), height_m); }

inline ObstacleQuery sphere(const geometry::Vec3& center, double radius_m) {
  return [=](const geometry::Vec3& from, const geometry::Vec3& to) -> std::optional<SurfaceHit> {
    const geometry::Vec3 d = to - from, m = from - center;
    const double a = d.squaredNorm(), b = m.dot(d), c = m.squaredNorm() - radius_m * radius_m;
    const double discriminant = b * b - a * c;
    if (a == 0.0 || discriminant < 0.0) return std::nullopt;
    for (const double root : {(-b - std::sqrt(discriminant)) / a, (-b + std::sqrt(discriminant)) / a}) {
      if (root < 0.0 || root > 1.0) continue;
      const geometry::Vec3 point = from + root * d;
      return SurfaceHit{point, (point - center).normalized()};
    }
    return std::nullopt;
  };
}

/// Whichever comes first.
inline ObstacleQuery first_of(const ObstacleQuery& a, const ObstacleQuery& b) {
  return [=](const geometry::Vec3& from, const geometry::Vec3& to) -> std::optional<SurfaceHit> {
    const auto first = a(from, to), second = b(from, to);
    if (!first || !second) return first ? first : second;
    return (first->point - from).squaredNorm() < (second->point - from).squaredNorm() ? first : second;
  };
}

}  // namespace tileflight::vehicle::test_support
