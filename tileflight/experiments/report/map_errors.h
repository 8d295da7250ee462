#pragma once

#include <optional>
#include <string>
#include <vector>

#include "tileflight/core/drawing/top_view.h"
#include "tileflight/experiments/report/run_folder.h"

namespace tileflight::report {

/// Returns a per-point scalar of a flight's aligned map; nullptr if it has none of that name.
const std::vector<float>* find_scalar(const FlightRun& flight, const std::string& name);

/// Returns the distances to the exact surface, else to voxel centres; nullptr without a map.
const std::vector<float>* best_distances(const FlightRun& flight);

/// The ground area over which a map was scored; outside it there is no reference surface.
struct ScoredRegion {
  std::optional<drawing::GroundExtent> extent;  ///< none: unlimited

  explicit ScoredRegion(const nlohmann::json& results);
  bool contains(const geometry::Vec3& p) const;
};

/// Returns the distances of the points inside the region, metres; infinite where unknown.
std::vector<double> distances_in_region(const ScoredRegion& region, const FlightRun& flight,
                                        const std::vector<float>& distances);

}  // namespace tileflight::report
