#pragma once

#include <array>
#include <cstdint>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "tileflight/evaluation/agreement.h"
#include "tileflight/geometry/transform.h"

namespace tileflight::evaluation {

/// Samples of the true surface that a flight's camera saw, evenly by area, with the distance from each to the nearest
/// map point.
struct SeenSurface {
  std::vector<geometry::Vec3> positions;
  std::vector<double> map_distance_m;
};

/// A cube of space with surface in it that both cameras saw.
struct PlaceCell {
  geometry::Vec3 center;
  std::array<std::size_t, 2> seen{}, mapped{};  ///< samples: simulated, real

  /// Fewer than half of the samples seen are in the map.
  bool missed(std::size_t flight) const { return 2 * mapped[flight] < seen[flight]; }
};

struct MissedPlacesOptions {
  double cell_m = 2.0;
  double within_m = 1.0;  ///< a sample with a map point this near is mapped
  double block_m = 20.0;  ///< edge of the blocks of the bootstrap
  int resamples = 2000;
  std::uint64_t seed = 1;
};

/// Whether the two flights miss the same places, of those that both cameras saw.
struct MissedPlaces {
  MissedPlacesOptions options;
  std::vector<PlaceCell> cells;  ///< in order of their place
  Agreement missed;
  std::array<double, 2> phi_ci95{};
  std::array<std::size_t, 2> seen_alone{};  ///< cells that only the simulated, only the real camera saw
};

/// Throws InputError: cells without size, not a distance for each position.
MissedPlaces missed_places(const SeenSurface& simulated, const SeenSurface& real,
                           const MissedPlacesOptions& options = {});

/// {cell, within, cells, seen_by_simulated_only, seen_by_real_only, missed (an agreement), phi_ci95}.
nlohmann::json to_json(const MissedPlaces& places);

/// A line a cell: x,y,z,seen_simulated,mapped_simulated,seen_real,mapped_real,missed ("none", "both", "simulated",
/// "real").
std::string places_csv(const MissedPlaces& places);

}  // namespace tileflight::evaluation
