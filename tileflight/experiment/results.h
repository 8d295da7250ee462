#pragma once

#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "tileflight/experiment/experiment_file.h"
#include "tileflight/experiment/pipeline.h"
#include "tileflight/experiment/stage_cache.h"

namespace tileflight::experiment {

/// results.json of a run folder (keys: contract), gathered from what its stages left there.
nlohmann::json collect_results(const Experiment& experiment, const Pipeline& pipeline, const StageCache& cache);

/// Files that a run was made from.
std::vector<std::filesystem::path> input_files(const Experiment& experiment);

}  // namespace tileflight::experiment
