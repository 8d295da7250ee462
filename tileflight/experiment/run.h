#pragma once

#include <filesystem>
#include <nlohmann/json.hpp>

#include "tileflight/experiment/experiment_file.h"
#include "tileflight/geometry/progress.h"

namespace tileflight::experiment {

/// The whole way that data takes, into `folder`: results.json (returned) and report.html. Stages that were done with
/// the same inputs are not done again; an interrupted run goes on. Throws InputError, also for a folder that holds
/// something else.
nlohmann::json run(const Experiment& experiment, const std::filesystem::path& folder, const Progress& progress = {});

/// Removes what an earlier run left in `folder`, so that the next does everything again. Throws InputError for a folder
/// that holds something else.
void forget_run(const std::filesystem::path& folder);

}  // namespace tileflight::experiment
