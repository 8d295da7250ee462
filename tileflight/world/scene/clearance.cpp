#include "tileflight/world/scene/clearance.h"

#include "tileflight/world/scene/surrounding_rays.h"

namespace tileflight::scene {

using geometry::Vec3;

Surroundings find_surroundings(const Scene& scene, const Vec3& point, double reach_m, double inside_reach_m) {
  return look_around(scene, point, reach_m, inside_reach_m).judge();
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
