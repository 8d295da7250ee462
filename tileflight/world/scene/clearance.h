#pragma once

// Whether a camera can follow a flight path: distance to surfaces, whether it is inside a solid, whether it crosses a
// surface.

#include <array>
#include <cstddef>
#include <cstdint>
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

/// Hits of rays from a point, from which judge() finds its Surroundings. The hits in several scenes, each of which
/// holds some of a place's surfaces, add up to those in the whole place (if surfaces are equally far to the last digit,
/// the other one's side may count).
struct SurroundingRays {
  static constexpr std::size_t kDirections = 128;
  /// Visible face of the first surface along a direction.
  enum class Side : std::uint8_t { kNone, kFront, kBack };

  double clearance_m = std::numeric_limits<double>::infinity();
  double above_ground_m = std::numeric_limits<double>::infinity();
  std::array<double, kDirections> distance_m{};  ///< to the first surface; of no meaning where there is none
  std::array<Side, kDirections> side{};

  /// Adds the hits of the same rays in another scene.
  void add(const SurroundingRays& other);
  Surroundings judge() const;
};

/// Casts the rays in a scene. The parameters are those of find_surroundings().
SurroundingRays look_around(const Scene& scene, const geometry::Vec3& point, double reach_m,
                            double inside_reach_m = 1e9);

}  // namespace tileflight::scene
