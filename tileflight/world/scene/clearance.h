#pragma once

// Tells whether a camera can follow a flight path: its distance to surfaces, and whether it is inside a solid or
// crosses a surface.

#include <limits>
#include <span>

#include "tileflight/world/scene/scene.h"

namespace tileflight::scene {

/// Surroundings of a point.
struct Surroundings {
  double clearance_m = std::numeric_limits<double>::infinity();     ///< to the nearest surface, in any direction
  double above_ground_m = std::numeric_limits<double>::infinity();  ///< to the first surface vertically below
  bool inside = false;                                              ///< inside a solid, or below the ground
};

/// Finds the surroundings of a point. `reach_m`: largest distance of the clearance. `inside_reach_m`: surfaces farther
/// away do not count for `inside`.
///
/// A point is inside if more of 128 evenly spread directions hit the back of the first surface than its front, and if
/// the same is true of more than half of the upward ones. A tileset is a shell that is seldom closed: the ground is
/// open at its sides, a house or tree crown at its bottom. From inside or below one, surfaces above show their backs
/// and few fronts are visible. Beside one, or under a bridge captured only from above, the ground shows more front than
/// the surfaces above show back. Surfaces modelled to be seen from inside (a scanned room) show fronts there.
Surroundings find_surroundings(const Scene& scene, const geometry::Vec3& point, double reach_m,
                               double inside_reach_m = 1e9);

/// Tells whether a surface intersects the polyline through these points.
bool path_hits_surface(const Scene& scene, std::span<const geometry::Vec3> way);

}  // namespace tileflight::scene
