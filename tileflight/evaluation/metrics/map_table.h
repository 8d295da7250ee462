#pragma once

#include <array>
#include <cstddef>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <vector>

#include "tileflight/evaluation/metrics/map_comparison.h"
#include "tileflight/evaluation/metrics/metrics_file.h"

namespace tileflight::metrics {

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
  Warnings warnings{};  ///< of both maps, each with its map's name; those of the ground truth once
};

/// Compares every pair of at least two maps, or with `against` every other map with that one, which is then the second
/// of each pair. Throws InputError as compare_runs() and compare_maps() do.
std::vector<ComparedPair> compare_all_pairs(const std::vector<ComparedMap>& maps,
                                            const DistanceComparisonOptions& options = {},
                                            const MapComparisonOptions& map_options = {},
                                            std::optional<std::size_t> against = std::nullopt);

/// A column of a table of maps: a number of metrics.json, or how many runs there are.
struct TableColumn {
  std::string key;    ///< in CSV, text and JSON: the number's name with its unit, or its path in metrics.json
  std::string title;  ///< in LaTeX
  std::string path;   ///< in metrics.json, "surface.accuracy.0.5"; "runs": their number
  int digits = 4;     ///< after the point
};

/// The columns of CSV and JSON unless others are chosen.
const std::vector<TableColumn>& default_columns();
/// The columns of LaTeX and text unless others are chosen.
std::vector<TableColumn> printed_columns();
/// Columns by the keys of default_columns(), or by the path of any number of metrics.json ("surface.accuracy.0.2").
/// Throws InputError, naming the most similar one, for a name that is neither known nor a number of one of the maps.
std::vector<TableColumn> choose_columns(const std::vector<std::string>& names, const std::vector<ComparedMap>& maps);

/// `maps` [{name, runs, points, …}] and `pairs` [{first, second, simultaneous_ci95, and the keys of a comparison}].
/// `columns`: further numbers of the maps.
nlohmann::json to_json(const std::vector<ComparedMap>& maps, const std::vector<ComparedPair>& pairs,
                       const std::vector<TableColumn>& columns = {});

/// CSV (RFC 4180), one line per map; fields of unknown numbers are empty.
std::string maps_csv(const std::vector<ComparedMap>& maps, const std::vector<TableColumn>& columns = default_columns());
/// A table for people, one line per map, in aligned columns; "-" for unknown numbers.
std::string maps_text(const std::vector<ComparedMap>& maps,
                      const std::vector<TableColumn>& columns = printed_columns());
/// CSV, one line per pair: the published metric, the decisive metrics, and the verdict.
std::string pairs_csv(const std::vector<ComparedMap>& maps, const std::vector<ComparedPair>& pairs);
/// Returns both tables, and the decisive metrics, as LaTeX `tabular` with booktabs rules.
std::string tables_tex(const std::vector<ComparedMap>& maps, const std::vector<ComparedPair>& pairs,
                       const std::vector<TableColumn>& columns = printed_columns());

}  // namespace tileflight::metrics
