#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "tileflight/evaluation/metrics/metrics.h"

namespace tileflight::base {
class StrictSection;
}

namespace tileflight::metrics {

/// Statistics of the distances to the exact surface for the map points in one box, without cut-off.
struct RegionScore {
  geometry::Box3 box;
  bool held_out = false;  ///< not used for alignment
  DistanceStatistics distances;
};

/// Scores by region and over all regions of each kind. Regions used for alignment score their own fit; held-out regions
/// are independent.
struct RegionScores {
  std::vector<RegionScore> each;
  DistanceStatistics aligned_on, held_out;
};

/// Scores points by region. `distances_m`: distance of each point, from surface_distances(). A point in several boxes
/// counts in each, and once in the overall statistics. A point inside an aligned-on box is not held out.
RegionScores score_regions(const std::vector<geometry::Vec3>& points, const std::vector<double>& distances_m,
                           const std::vector<geometry::Box3>& aligned_on, const std::vector<geometry::Box3>& held_out);

/// Returns the key `regions` of metrics.json.
nlohmann::json to_json(const RegionScores& scores);
RegionScores read_region_scores(base::StrictSection section);

}  // namespace tileflight::metrics
