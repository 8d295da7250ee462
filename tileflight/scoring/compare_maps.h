#pragma once

#include <cstdint>
#include <filesystem>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "tileflight/scoring/evaluation_settings.h"

namespace tileflight::scoring {

/// Files written by compare_maps(); an empty path: not written.
struct ComparisonFiles {
  std::filesystem::path csv;  ///< a line per map; the pairs go to NAME-pairs.csv beside it
  std::filesystem::path tex;  ///< both tables
};

/// Compares two flights, each with the metrics.json of every run (errors.ply and the seen surface beside each), the
/// first run first. Throws InputError.
nlohmann::json compare_flights(const std::vector<std::filesystem::path>& simulated,
                               const std::vector<std::filesystem::path>& real, const EvaluationSettings& settings,
                               std::uint64_t seed);

/// Compares any number of scored maps. Each argument is a metrics.json (with errors.ply beside it), or a run folder,
/// which stands for its flights with all their runs. Returns `maps` and `pairs` (evaluation::to_json); for two maps
/// also the keys of their comparison. Throws InputError.
nlohmann::json compare_maps(const std::vector<std::filesystem::path>& arguments, const EvaluationSettings& settings,
                            std::uint64_t seed, const ComparisonFiles& files);

/// Tests whether simulation ranks algorithms or settings in the same order as reality: each run folder is one of them,
/// with a simulated and a real flight. `by`: the number by which they are ranked, as a path in metrics.json
/// ("map.mean", "surface.median", "trajectory.ate_rmse"). Returns {by, list [{name, simulated, real}], items, tau_b,
/// ci95, … (evaluation::rank_correlation)}. Throws InputError: fewer than two folders, a missing number.
nlohmann::json compare_ranking(const std::vector<std::filesystem::path>& run_folders, const std::string& by,
                               std::uint64_t seed);

}  // namespace tileflight::scoring
