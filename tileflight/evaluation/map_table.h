#pragma once

#include <array>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "tileflight/evaluation/map_comparison.h"
#include "tileflight/evaluation/metrics_file.h"

namespace tileflight::evaluation {

/// A scored map in a table of several; `runs` are its kept distances, the first run's in front (see compare_runs()),
/// and `scored` the same runs for compare_maps(), empty where one has no exact surface.
struct ComparedMap {
  std::string name;
  Metrics metrics;
  std::vector<KeptDistances> runs;
  std::vector<ScoredMap> scored{};
};

/// Two of the maps, by their place in the list; the difference is first minus second.
struct ComparedPair {
  std::size_t first = 0, second = 0;
  Comparison comparison;              ///< by the published measure
  std::optional<MapComparison> maps;  ///< where both have an exact surface
  /// Interval of the difference, by blocks of the first runs, such that those of all pairs hold together in 95 of 100
  /// cases (Bonferroni).
  std::array<double, 2> simultaneous_ci95{};
  Doubts doubts{};  ///< of both maps, each under its map's name; the truth's once
};

/// Every pair of at least two maps. Throws InputError as compare() and compare_maps() do.
std::vector<ComparedPair> compare_all(const std::vector<ComparedMap>& maps, const ComparisonOptions& options = {},
                                      const MapComparisonOptions& map_options = {});

/// `maps` [{name, points, …}] and `pairs` [{first, second, simultaneous_ci95, and the keys of a comparison}].
nlohmann::json to_json(const std::vector<ComparedMap>& maps, const std::vector<ComparedPair>& pairs);

/// A line a map (RFC 4180); a field is empty where the number is not known.
std::string maps_csv(const std::vector<ComparedMap>& maps);
/// A line a pair: the published measure, then those that the verdict rests on, and the verdict.
std::string pairs_csv(const std::vector<ComparedMap>& maps, const std::vector<ComparedPair>& pairs);
/// Both, and what the verdicts rest on, as `tabular` with the rules of booktabs.
std::string tables_tex(const std::vector<ComparedMap>& maps, const std::vector<ComparedPair>& pairs);

}  // namespace tileflight::evaluation
