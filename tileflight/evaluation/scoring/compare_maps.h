#pragma once

#include <cstdint>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "tileflight/evaluation/scoring/evaluation_settings.h"

namespace tileflight::scoring {

/// A scored map that an argument of `compare` names: metrics.json of its runs, the first run first.
struct FoundMap {
  std::string name;  ///< "stadium/real" of out/stadium/real, "stadium/dark/simulated" of the run's variant "dark"
  std::vector<std::filesystem::path> metrics_files{};
};

/// Finds the maps that the arguments name, in their order. Each argument is a metrics.json, or a run folder, which
/// stands for its flights with all their runs and for those of its variants. Names are ends of paths, as long as it
/// takes to tell all maps apart; the same map named twice has a number. Throws InputError for a folder without a scored
/// map.
std::vector<FoundMap> find_maps(const std::vector<std::filesystem::path>& arguments);

/// Returns the maps whose names match one of the patterns (`*`, `?`, `[a-z]`; `*` matches slashes, too), in the order
/// of the patterns, then of the maps. Throws InputError for a pattern that matches none, naming the most similar name.
std::vector<FoundMap> choose_maps(const std::vector<FoundMap>& maps, const std::vector<std::string>& patterns);

/// Returns the one map that `baseline` names: by a name or a pattern among `maps`, else as a path. Throws InputError if
/// it is none, or several.
FoundMap find_baseline(const std::vector<FoundMap>& maps, const std::string& baseline);

/// Files written by compare_maps(); an empty path: not written.
struct ComparisonFiles {
  std::filesystem::path csv;     ///< a line per map; the pairs go to NAME-pairs.csv beside it
  std::filesystem::path tex;     ///< both tables
  std::filesystem::path text{};  ///< the table of maps, for people
};

/// Selects the maps that are compared, and the columns that are shown.
struct MapSelection {
  std::vector<std::string> rows{};  ///< names or patterns (choose_maps()); empty: all
  std::string against{};            ///< the map that the others are compared with (find_baseline()); empty: all pairs
  std::vector<std::string> columns{};  ///< metrics::choose_columns(); empty: the usual ones
};

/// Result of compare_maps().
struct MapsComparison {
  nlohmann::json json;  ///< `maps` and `pairs`; for two maps also the keys of their comparison
  std::string table;    ///< the maps, for people
};

/// Compares two flights, each with the metrics.json of every run (errors.ply and the seen surface beside each), the
/// first run first. Throws InputError.
nlohmann::json compare_flights(const std::vector<std::filesystem::path>& simulated,
                               const std::vector<std::filesystem::path>& real, const EvaluationSettings& settings,
                               std::uint64_t seed);

/// Compares any number of scored maps: those that the arguments name (find_maps(); errors.ply is beside each
/// metrics.json). Throws InputError.
MapsComparison compare_maps(const std::vector<std::filesystem::path>& arguments, const EvaluationSettings& settings,
                            std::uint64_t seed, const ComparisonFiles& files, const MapSelection& selection = {});

/// Tests whether simulation ranks algorithms or settings in the same order as reality: each run folder is one of them,
/// with a simulated and a real flight. `by`: the number by which they are ranked, as a path in metrics.json
/// ("map.mean", "surface.median", "trajectory.ate_rmse"). Returns {by, list [{name, simulated, real}], items, tau_b,
/// ci95, … (metrics::rank_correlation)}. Throws InputError: fewer than two folders, a missing number.
nlohmann::json compare_ranking(const std::vector<std::filesystem::path>& run_folders, const std::string& by,
                               std::uint64_t seed);

}  // namespace tileflight::scoring
