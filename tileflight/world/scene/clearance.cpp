#include "tileflight/world/scene/clearance.h"

#include <array>
#include <cmath>
#include <cstddef>
#include <numbers>

namespace tileflight::scene {

namespace {

using geometry::Vec3;

constexpr std::size_t kDirections = 128;

/// Evenly spread directions: successive points differ by the golden angle, heights in equal steps (Swinbank and Purser,
/// Quarterly Journal of the Royal Meteorological Society 132, 2006).
std::array<Vec3, kDirections> fibonacci_sphere() {
  std::array<Vec3, kDirections> directions;
  for (std::size_t i = 0; i < kDirections; ++i) {
    const double z = 1.0 - (2.0 * static_cast<double>(i) + 1.0) / kDirections;
    const double around = std::numbers::pi * (3.0 - std::sqrt(5.0)) * static_cast<double>(i);
    const double across = std::sqrt(1.0 - z * z);
    directions[i] = {across * std::cos(around), across * std::sin(around), z};
  }
  return directions;
}

const std::array<Vec3, kDirections>& directions() {
  static const std::array<Vec3, kDirections> kAll = fibonacci_sphere();
  return kAll;
}

}  // namespace

Surroundings find_surroundings(const Scene& scene, const Vec3& point, double reach_m, double inside_reach_m) {
  Surroundings around;
  if (const auto nearest = scene.distance_to_surface_m(point, reach_m)) around.clearance_m = *nearest;
  if (const auto below = scene.intersect({point, -Vec3::UnitZ()})) around.above_ground_m = below->distance_m;
  int fronts = 0, backs = 0, upwards = 0, backs_upwards = 0;
  for (const Vec3& direction : directions()) {
    const bool is_upward = direction.z() >= 0.5;  // within 60 degrees of vertical
    upwards += is_upward ? 1 : 0;
    const auto hit = scene.intersect({point, direction}, inside_reach_m);
    if (!hit) continue;
    const bool is_back = scene.normal(*hit).dot(direction) > 0;
    (is_back ? backs : fronts) += 1;
    backs_upwards += is_back && is_upward ? 1 : 0;
  }
  around.inside = backs > fronts && 2 * backs_upwards > upwards;
  return around;
}

bool path_hits_surface(const Scene& scene, std::span<const Vec3> way) {
  constexpr double kStill_m = 1e-6;
  for (std::size_t i = 0; i + 1 < way.size(); ++i) {
    const Vec3 step = way[i + 1] - way[i];
    const double length_m = step.norm();
    if (length_m > kStill_m && scene.is_occluded({way[i], step / length_m}, length_m)) return true;
  }
  return false;
}

}  // namespace tileflight::scene
