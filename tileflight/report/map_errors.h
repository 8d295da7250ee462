#pragma once

#include <optional>
#include <string>
#include <vector>

#include "tileflight/report/run_folder.h"
#include "tileflight/report/top_view.h"

namespace tileflight::report {

/// A scalar of a flight's aligned map, where it has it.
const std::vector<float>* scalar(const FlightRun& flight, const std::string& name);

/// Distances to the exact surface, else to voxel centres; null without a map.
const std::vector<float>* best_distances(const FlightRun& flight);

/// The ground over which a map was scored: beside it there is no surface to be measured against.
struct ScoredRegion {
  std::optional<GroundExtent> extent;  ///< none: everywhere

  explicit ScoredRegion(const nlohmann::json& results);
  bool holds(const geometry::Vec3& p) const;
};

/// The distances of the points over the region; infinite where they are not known.
std::vector<double> distances_over(const ScoredRegion& region, const FlightRun& flight,
                                   const std::vector<float>& distances);

}  // namespace tileflight::report
