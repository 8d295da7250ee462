#pragma once

#include <limits>
#include <span>
#include <vector>

#include "tileflight/scene/scene.h"

// Whether a camera can be where a flight takes it: how near surfaces are, whether it is inside one or goes through one.
namespace tileflight::scene {

/// What is around a point.
struct Surroundings {
  double clearance_m = std::numeric_limits<double>::infinity();     ///< to the nearest surface, in any direction
  double above_ground_m = std::numeric_limits<double>::infinity();  ///< down to the first surface straight below
  bool inside = false;                                              ///< of a solid, or beneath the ground
};

/// `reach_m`: surfaces farther than this are not looked for, but straight below.
///
/// Inside: of 128 even directions, more see the back of the first surface than its front, and so do more than half of
/// those that go up. A tileset is a shell, seldom closed: ground is open at its sides, a house or a crown of leaves
/// open at its bottom. From within or beneath one, what is above shows its back, and little shows its front; beside
/// one, or under a bridge that was only seen from above, the ground shows more of its front than what is above shows of
/// its back. Surfaces whose backs were modelled to be seen from within (a scanned room) show fronts there.
Surroundings surroundings_at(const Scene& scene, const geometry::Vec3& point, double reach_m);

/// Whether a surface lies on the way along these points.
bool passes_through(const Scene& scene, std::span<const geometry::Vec3> way);

/// The surroundings of a path's points, and whether the way from each to the next goes through a surface (the last one:
/// false). In parallel, the same for any number of threads.
struct PathClearance {
  std::vector<Surroundings> at;
  std::vector<bool> blocked_after;
};
PathClearance clearance_along(const Scene& scene, const std::vector<geometry::Vec3>& path, double reach_m);

}  // namespace tileflight::scene
