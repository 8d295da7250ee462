#pragma once

#include <array>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <vector>

#include "tileflight/evaluation/map_comparison.h"
#include "tileflight/evaluation/metrics_file.h"

namespace tileflight::evaluation {

/// A scored map in a table of several. `runs`: its kept distances, one per run (see compare_runs()); `scored`: the same
/// runs for compare_maps(), empty if one has no exact surface.
struct ComparedMap {
  std::string name;
  Metrics metrics;
  std::vector<KeptDistances> runs;
  std::vector<ScoredMap> scored{};
};

/// A pair of maps, by index; differences are first minus second.
struct ComparedPair {
  std::size_t first = 0, second = 0;
  DistanceComparison comparison;      ///< by the published metric
  std::optional<MapComparison> maps;  ///< if both have an exact surface
  /// Interval of the difference, by blocks of the first runs, with 95 % joint coverage over all pairs (Bonferroni).
  std::array<double, 2> simultaneous_ci95{};
  Doubts doubts{};  ///< of both maps, each with its map's name; those of the ground truth once
};

/// Compares every pair of at least two maps. Throws InputError as compare_runs() and compare_maps() do.
std::vector<ComparedPair> compare_all_pairs(const std::vector<ComparedMap>& maps,
                                            const DistanceComparisonOptions& options = {},
                                            const MapComparisonOptions& map_options = {});

/// `maps` [{name, points, …}] and `pairs` [{first, second, simultaneous_ci95, and the keys of a comparison}].
nlohmann::json to_json(const std::vector<ComparedMap>& maps, const std::vector<ComparedPair>& pairs);

/// CSV (RFC 4180), one line per map; fields of unknown numbers are empty.
std::string maps_csv(const std::vector<ComparedMap>& maps);
/// CSV, one line per pair: the published metric, the decisive metrics, and the verdict.
std::string pairs_csv(const std::vector<ComparedMap>& maps, const std::vector<ComparedPair>& pairs);
/// Both tables, and the decisive metrics, as LaTeX `tabular` with booktabs rules.
std::string tables_tex(const std::vector<ComparedMap>& maps, const std::vector<ComparedPair>& pairs);

}  // namespace tileflight::evaluation
