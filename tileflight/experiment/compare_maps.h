#pragma once

#include <cstdint>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "tileflight/experiment/experiment_file.h"

namespace tileflight::experiment {

/// What compare_maps() leaves beside the JSON; an empty path: not written.
struct CompareFiles {
  std::filesystem::path csv;  ///< a line a map; the pairs go to NAME-pairs.csv beside it
  std::filesystem::path tex;  ///< both tables
};

/// Two flights against each other: metrics.json (with errors.ply and seen.ply beside each) of every run, the first
/// run's in front. Throws InputError.
nlohmann::json compare(const std::vector<std::filesystem::path>& simulated,
                       const std::vector<std::filesystem::path>& real, const EvaluationSettings& settings,
                       std::uint64_t seed);

/// Any number of scored maps against each other. Each argument is a metrics.json (errors.ply beside it), or a run
/// folder, which stands for its flights with all their runs. Returns `maps` and `pairs` (evaluation::to_json); for two
/// maps also the keys of their comparison itself. Throws InputError.
nlohmann::json compare_maps(const std::vector<std::filesystem::path>& arguments, const EvaluationSettings& settings,
                            std::uint64_t seed, const CompareFiles& files);

/// Whether simulation puts algorithms or settings into the order that reality does: each run folder is one of them,
/// with a simulated and a real flight. `by`: the number that ranks them, by its place in metrics.json ("map.mean",
/// "surface.median", "trajectory.ate_rmse"). Returns {by, list [{name, simulated, real}], items, tau_b, ci95, …
/// (evaluation::rank_correlation)}. Throws InputError: fewer than two folders, a number that is not there.
nlohmann::json compare_ranking(const std::vector<std::filesystem::path>& run_folders, const std::string& by,
                               std::uint64_t seed);

}  // namespace tileflight::experiment
