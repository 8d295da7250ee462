#pragma once

#include <filesystem>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <vector>

#include "tileflight/evaluation/metrics/metrics.h"
#include "tileflight/evaluation/scoring/receiver_truth.h"

namespace tileflight::scoring {

/// Estimated trajectories, without any map, and how they are compared with the true one.
struct TrajectoryScoring {
  std::vector<std::filesystem::path> estimates;  ///< TUM, EuRoC or KITTI files (geometry::read_trajectory)
  std::filesystem::path truth;                   ///< likewise, a dataset folder, or what read_receiver_truth() reads
  metrics::TrajectoryOptions options;            ///< the pairing is set from the files
  /// Added to the times of the estimates; nullopt: estimated, which needs a receiver's positions as truth.
  std::optional<double> time_offset_s = 0.0;
  geometry::Vec3 lever_arm_m = geometry::Vec3::Zero();  ///< of the receiver's antenna in the camera
};

/// The file in which evaluate_trajectories() stores the aligned poses with their errors, for the report.
std::filesystem::path trajectory_errors_file(const std::filesystem::path& metrics_json);

/// Scores the estimates. Writes metrics.json to `out`, and trajectory_errors_file() beside it (docs/formats.md).
/// Returns the content of metrics.json: `trajectory` for one estimate, `trajectories` with names for several. The names
/// are those of the files, or, where two are equal, the paths as given. Throws InputError.
nlohmann::json evaluate_trajectories(const TrajectoryScoring& scoring, const std::filesystem::path& out);

/// Scores what can be scored of a flight without its place: the path, against the dataset's true poses or recorded
/// positions, after a Sim(3). Writes metrics.json to `out`; `trajectory` is null where the dataset has neither or they
/// cannot be compared, with a warning that says why. The warnings include the odometry's.
void score_flight_without_place(const std::filesystem::path& odometry, const std::filesystem::path& dataset,
                                const std::filesystem::path& out);

}  // namespace tileflight::scoring
