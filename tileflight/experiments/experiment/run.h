#pragma once

#include <filesystem>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "tileflight/capture/recording/render_stage.h"
#include "tileflight/core/base/progress.h"
#include "tileflight/experiments/experiment/experiment_file.h"
#include "tileflight/experiments/experiment/stage_cache.h"

namespace tileflight::experiment {

/// Options of run().
struct RunOptions {
  bool rerun_all = false;            ///< execute all stages again; earlier results are kept until they are replaced
  StageListener listener;            ///< notified of each stage
  std::filesystem::path original{};  ///< run folder of which this is a variant (StageCache); empty: none
  /// Folder of truths and built-in places that runs share (folder_cache.h); empty: each run has its own.
  std::filesystem::path truth_cache{};
  /// Only the place, its truth and the flights' datasets; without results and report. Odometry and alignment of the
  /// second flight are included if the simulated one follows it.
  bool until_datasets = false;
  /// until_datasets: only these of "simulated" and "real", and what they follow; empty: all.
  std::vector<std::string> flights{};
  recording::AutopilotFlyer fly_autopilot{};  ///< RenderSettings::fly_autopilot
};

/// Executes the complete experiment in `folder`: results.json (returned; null until_datasets) and report.html. Stages
/// whose inputs have not changed are skipped; an interrupted run continues and reuses its rendered frames. Throws
/// InputError, also if the folder holds something else or is in use by another process.
nlohmann::json run(const Experiment& experiment, const std::filesystem::path& folder, const Progress& progress = {},
                   const RunOptions& options = {});

}  // namespace tileflight::experiment
