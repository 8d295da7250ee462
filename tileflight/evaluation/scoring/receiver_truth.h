#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "tileflight/core/alignment/align_trajectory.h"
#include "tileflight/core/base/warning.h"
#include "tileflight/data/flight_logs/telemetry.h"
#include "tileflight/evaluation/metrics/metrics.h"

namespace tileflight::scoring {

/// Positions that a receiver recorded during a flight, or that its images were located at, as the reference of a
/// trajectory's positions.
struct ReceiverTruth {
  std::string what = "a receiver's positions";
  std::vector<alignment::PositionFix> fixes;  ///< east, north, up, metres; on the receiver's clock
  flight_logs::Telemetry telemetry;           ///< the log; empty for a dataset's gps.csv
  bool has_own_sigmas = true;                 ///< false: the standard deviations are assumed, the log states none
  std::vector<std::string> warnings;          ///< of the log's reader
};

/// Reads the positions of a flight log, a video with telemetry, a folder of photos with positions, a folder that
/// localize() wrote, or a dataset without true poses. nullopt for a file of poses and a dataset with true poses. Throws
/// InputError as the readers do.
std::optional<ReceiverTruth> read_receiver_truth(const std::filesystem::path& file);

/// Selects how a trajectory is compared with a receiver's positions.
struct ReceiverScoring {
  std::optional<double> time_offset_s;  ///< added to the estimate's times to get the receiver's; nullopt: estimated
  geometry::Vec3 lever_arm_m = geometry::Vec3::Zero();  ///< of the antenna in the camera: right, down, forward
};

/// A trajectory that is aligned to a receiver's positions.
struct ReceiverScore {
  /// The antenna's positions by the estimate at the times of the fixes, and the fixes. Receivers measure no rotations:
  /// both have the estimate's.
  metrics::PairedTrajectories poses;
  metrics::ReceiverError receiver;
  Warnings warnings;
};

/// Aligns a trajectory to the fixes robustly (alignment::align_trajectory), with a Sim(3) or SE(3). Fixes between poses
/// that are too far apart to interpolate are left out, held ones count once. Throws InputError (cause) for an alignment
/// of kNone, fewer than three fixes within the estimate's time, and a clock offset that the motion does not determine.
ReceiverScore score_by_receiver(const geometry::Trajectory& estimate, const ReceiverTruth& truth,
                                metrics::TrajectoryAlignment alignment, const ReceiverScoring& scoring,
                                const std::string& name);

/// Returns the metrics of a trajectory that was compared with a receiver's positions, `receiver` among them.
metrics::TrajectoryMetrics score_trajectory(const ReceiverScore& score, const metrics::TrajectoryOptions& options);

/// Scores the path of a flight by the positions in its dataset. Returns nullopt, and says why, if they cannot be
/// compared.
std::optional<metrics::TrajectoryMetrics> score_by_recorded_positions(const geometry::Trajectory& estimate,
                                                                      const std::filesystem::path& dataset,
                                                                      Warnings& warnings);

}  // namespace tileflight::scoring
