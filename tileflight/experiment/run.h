#pragma once

#include <filesystem>
#include <nlohmann/json.hpp>

#include "tileflight/experiment/experiment_file.h"
#include "tileflight/experiment/stage_cache.h"
#include "tileflight/geometry/progress.h"

namespace tileflight::experiment {

struct RunOptions {
  bool again = false;      ///< do all stages again; what an earlier run left stays until it is replaced
  StageListener listener;  ///< told of each stage
};

/// The whole way that data takes, into `folder`: results.json (returned) and report.html. Stages that were done with
/// the same inputs are not done again; an interrupted run goes on, and takes up the frames that it has rendered. Throws
/// InputError, also for a folder that holds something else or that another process works in.
nlohmann::json run(const Experiment& experiment, const std::filesystem::path& folder, const Progress& progress = {},
                   const RunOptions& options = {});

}  // namespace tileflight::experiment
