#pragma once

#include <array>
#include <cstdint>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "tileflight/core/geometry/transform.h"
#include "tileflight/evaluation/metrics/contingency_table.h"

namespace tileflight::metrics {

/// Samples of the true surface seen by a flight's camera, uniform by area, with the distance of each to the nearest map
/// point.
struct SeenSurface {
  std::vector<geometry::Vec3> positions;
  std::vector<double> map_distance_m;
};

/// A cube of space that contains surface seen by both cameras.
struct SurfaceCell {
  geometry::Vec3 center;
  std::array<std::size_t, 2> seen{}, mapped{};  ///< numbers of samples: simulated, real

  /// Whether fewer than half of the samples seen are in the map.
  bool missed(std::size_t flight) const { return 2 * mapped[flight] < seen[flight]; }
};

struct MissedPlacesOptions {
  double cell_m = 2.0;
  double within_m = 1.0;  ///< a sample with a map point within this distance is mapped
  double block_m = 20.0;  ///< edge of the blocks of the bootstrap
  int resamples = 2000;
  std::uint64_t seed = 1;
};

/// Agreement of two flights on missed places, among those that both cameras saw.
struct MissedPlaces {
  MissedPlacesOptions options;
  std::vector<SurfaceCell> cells;  ///< in spatial order
  ContingencyTable missed;
  std::array<double, 2> phi_ci95{};
  std::array<std::size_t, 2> seen_alone{};  ///< cells seen only by the simulated, only by the real camera
};

/// Finds the places that each flight missed, and how far the flights agree on them. Throws InputError if the cell size
/// is not positive or there is not one distance per position.
MissedPlaces missed_places(const SeenSurface& simulated, const SeenSurface& real,
                           const MissedPlacesOptions& options = {});

/// Returns {cell, within, cells, seen_by_simulated_only, seen_by_real_only, missed (an agreement), phi_ci95}.
nlohmann::json to_json(const MissedPlaces& places);

/// Returns CSV, one line per cell: x,y,z,seen_simulated,mapped_simulated,seen_real,mapped_real,missed ("none", "both",
/// "simulated", "real").
std::string missed_places_csv(const MissedPlaces& places);

}  // namespace tileflight::metrics
