#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "tileflight/evaluation/json_reader.h"
#include "tileflight/evaluation/metrics.h"

namespace tileflight::evaluation {

/// Distances to the exact surface of the map points in one box, nothing cut off but by the box.
struct RegionScore {
  geometry::Box3 box;
  bool held_out = false;  ///< not aligned on
  DistanceStatistics distances;
};

/// By region, and over all of each kind: what was aligned on scores itself, what was held out does not.
struct RegionScores {
  std::vector<RegionScore> each;
  DistanceStatistics aligned_on, held_out;
};

/// `distances_m`: of each point, as surface_distances() gives them; a point that lies in several boxes counts in each,
/// and once over all. A point inside of an aligned-on box is not held out.
RegionScores score_regions(const std::vector<geometry::Vec3>& points, const std::vector<double>& distances_m,
                           const std::vector<geometry::Box3>& aligned_on, const std::vector<geometry::Box3>& held_out);

/// `regions` of metrics.json, and back. Throws InputError as JsonReader does.
nlohmann::json to_json(const RegionScores& scores);
RegionScores read_region_scores(JsonReader reader, const std::string& where);

}  // namespace tileflight::evaluation
