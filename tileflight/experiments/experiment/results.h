#pragma once

#include <filesystem>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "tileflight/experiments/experiment/experiment_file.h"
#include "tileflight/experiments/experiment/pipeline.h"
#include "tileflight/experiments/experiment/stage_cache.h"

namespace tileflight::experiment {

/// Builds results.json of a run folder (keys: see the contract) from the results of its stages.
nlohmann::json collect_results(const Experiment& experiment, const Pipeline& pipeline, const StageCache& cache);

/// The input files of an experiment.
std::vector<std::filesystem::path> input_files(const Experiment& experiment);

}  // namespace tileflight::experiment
