#pragma once

#include <filesystem>
#include <functional>
#include <nlohmann/json.hpp>
#include <vector>

#include "tileflight/experiment/pipeline.h"

namespace tileflight::experiment {

// A flight that is tracked more than once (`odometry: {runs: N}`). The first run counts as the flight's result and must
// not fail; a further one may, and then that is a result too.

/// Does the stages of one run. An InputError of a further run is noted in its folder instead of thrown.
void attempt(const OdometryRun& run, const std::function<void()>& stages);

/// Throws InputError when the odometry of a run tracked no frame.
void require_map(const OdometryRun& run, const std::filesystem::path& dataset);

/// Removes the results of further runs that are not asked for any more.
void forget_other_runs(const std::filesystem::path& flight, const std::vector<OdometryRun>& runs);

/// metrics.json of the runs that did not fail, the first run's in front.
std::vector<std::filesystem::path> scored(const std::vector<OdometryRun>& runs);

/// {n, failed, distinct (different maps), list [{name, seed, from, backwards, failed (why, or null), frames_tracked,
/// lost, points, mean, surface_median, ate_rmse}], spread (evaluation::spread_of_numbers over metrics.json)}; null for
/// a single run.
nlohmann::json describe_runs(const std::vector<OdometryRun>& runs, const StageCache& cache);

}  // namespace tileflight::experiment
