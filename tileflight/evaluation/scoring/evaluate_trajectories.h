#pragma once

#include <filesystem>
#include <nlohmann/json_fwd.hpp>
#include <vector>

#include "tileflight/evaluation/metrics/metrics.h"

namespace tileflight::scoring {

/// Estimated trajectories, without any map, and how they are compared with the true one.
struct TrajectoryScoring {
  std::vector<std::filesystem::path> estimates;  ///< TUM, EuRoC or KITTI files (geometry::read_trajectory)
  std::filesystem::path truth;                   ///< likewise, or a dataset folder with true poses
  metrics::TrajectoryOptions options;            ///< the pairing is set from the files
  double time_offset_s = 0.0;                    ///< added to the times of the estimates
};

/// The file in which evaluate_trajectories() stores the aligned poses with their errors, for the report.
std::filesystem::path trajectory_errors_file(const std::filesystem::path& metrics_json);

/// Scores the estimates. Writes metrics.json to `out`, and trajectory_errors_file() beside it (docs/formats.md).
/// Returns the content of metrics.json: `trajectory` for one estimate, `trajectories` with names for several. The names
/// are those of the files, or, where two are equal, the paths as given. Throws InputError.
nlohmann::json evaluate_trajectories(const TrajectoryScoring& scoring, const std::filesystem::path& out);

}  // namespace tileflight::scoring
