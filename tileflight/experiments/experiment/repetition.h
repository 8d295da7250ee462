#pragma once

#include <filesystem>
#include <functional>
#include <nlohmann/json_fwd.hpp>
#include <vector>

#include "tileflight/experiments/experiment/pipeline.h"

namespace tileflight::experiment {

// Flights that are tracked several times (`odometry: {runs: N}`). The first run is the flight's result and must
// succeed; the failure of a further run is recorded as a result.

/// Executes the stages of one run. An InputError in a further run is recorded in its folder instead of thrown.
void run_repetition(const OdometryRun& run, const std::function<void()>& stages);

/// Throws InputError if the odometry of a run tracked no frame.
void require_tracked_frames(const OdometryRun& run, const std::filesystem::path& dataset);

/// Removes the results of further runs that are no longer requested.
void remove_stale_runs(const std::filesystem::path& flight, const std::vector<OdometryRun>& runs);

/// metrics.json of the successful runs, the first run first.
std::vector<std::filesystem::path> scored_metrics_files(const std::vector<OdometryRun>& runs);

/// Returns {n, failed, distinct (different maps), list [{name, seed, from, backwards, failed (cause, or null),
/// frames_tracked, lost, points, mean, surface_median, ate_rmse}], spread (metrics::compute_json_spread over
/// metrics.json)}; null for a single run.
nlohmann::json describe_runs(const std::vector<OdometryRun>& runs, const StageCache& cache);

}  // namespace tileflight::experiment
