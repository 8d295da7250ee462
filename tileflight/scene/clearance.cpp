#include "tileflight/scene/clearance.h"

#include <tbb/parallel_for.h>

#include <array>
#include <cmath>
#include <cstdint>
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

/// Visible face of the first surface along a direction.
enum class Side { kNone, kFront, kBack };

Side side_seen(const Scene& scene, const Ray& ray, double reach_m) {
  const auto hit = scene.intersect(ray, reach_m);
  if (!hit) return Side::kNone;
  return scene.normal(*hit).dot(ray.direction) > 0 ? Side::kBack : Side::kFront;
}

bool is_inside(const Scene& scene, const Vec3& point, double reach_m) {
  static const std::array<Vec3, kDirections> kAll = fibonacci_sphere();
  int fronts = 0, backs = 0, upwards = 0, backs_upwards = 0;
  for (const Vec3& direction : kAll) {
    const Side side = side_seen(scene, {point, direction}, reach_m);
    fronts += side == Side::kFront ? 1 : 0;
    backs += side == Side::kBack ? 1 : 0;
    if (direction.z() < 0.5) continue;  // within 60 degrees of vertical
    ++upwards;
    backs_upwards += side == Side::kBack ? 1 : 0;
  }
  return backs > fronts && 2 * backs_upwards > upwards;
}

}  // namespace

Surroundings find_surroundings(const Scene& scene, const Vec3& point, double reach_m, double inside_reach_m) {
  Surroundings around;
  if (const auto nearest = scene.distance_to_surface_m(point, reach_m)) around.clearance_m = *nearest;
  if (const auto below = scene.intersect({point, -Vec3::UnitZ()})) around.above_ground_m = below->distance_m;
  around.inside = is_inside(scene, point, inside_reach_m);
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
