#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>

#include "tileflight/world/scene/clearance.h"
#include "tileflight/world/scene/scene.h"

namespace tileflight::scene {

/// What rays from a point meet: Surroundings before they are judged. Those of several scenes, each of which holds some
/// of a place's surfaces, add up to those of all (only of surfaces that are equally far to the last digit, another's
/// side may count).
struct SurroundingRays {
  static constexpr std::size_t kDirections = 128;
  /// Visible face of the first surface along a direction.
  enum class Side : std::uint8_t { kNone, kFront, kBack };

  double clearance_m = std::numeric_limits<double>::infinity();
  double above_ground_m = std::numeric_limits<double>::infinity();
  std::array<double, kDirections> distance_m{};  ///< to the first surface; of no meaning where there is none
  std::array<Side, kDirections> side{};

  /// Adds what the same rays meet in another scene.
  void add(const SurroundingRays& other);
  Surroundings judge() const;
};

/// Parameters as those of find_surroundings().
SurroundingRays look_around(const Scene& scene, const geometry::Vec3& point, double reach_m,
                            double inside_reach_m = 1e9);

}  // namespace tileflight::scene
