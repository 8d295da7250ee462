#pragma once

#include <filesystem>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <vector>

#include "tileflight/core/alignment/align_trajectory.h"
#include "tileflight/core/base/warning.h"
#include "tileflight/data/flight_logs/telemetry.h"
#include "tileflight/evaluation/metrics/metrics.h"

namespace tileflight::scoring {

/// Positions that a receiver recorded during a flight, as the truth of a trajectory's positions.
struct ReceiverTruth {
  std::vector<alignment::PositionFix> fixes;  ///< east, north, up of the first one, metres; on the receiver's clock
  flight_logs::Telemetry telemetry;           ///< the log; empty for a dataset's gps.csv
  bool has_own_sigmas = true;                 ///< false: the standard deviations are assumed, the log states none
  std::vector<std::string> warnings;          ///< of the log's reader
};

/// Reads the positions of a flight log, a video with telemetry, a folder of photos with positions, or a dataset without
/// true poses. nullopt for a file of poses and a dataset with true poses. Throws InputError as the readers do.
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
  double time_offset_s = 0.0;        ///< added to the estimate's times
  double time_offset_sigma_s = 0.0;  ///< 0: not estimated
  double horizontal_sigma_m = 0.0;   ///< RMS of the fixes' standard deviations, each horizontal axis
  double vertical_sigma_m = 0.0;
  double expected_rmse_m = 0.0;           ///< error of a perfect trajectory, by these standard deviations
  double normalized_error_squared = 0.0;  ///< mean of the squared errors over their variances, each axis; 1: as stated
  std::optional<double> beyond_receiver_m;  ///< RMS of the error that the receiver does not explain; nullopt: none
  Warnings warnings;
};

/// Aligns a trajectory to the fixes robustly (alignment::align_trajectory), with a Sim(3) or SE(3). Fixes in gaps of
/// the estimate are left out, held ones count once. Throws InputError (cause) for an alignment of kNone, fewer than
/// three fixes within the estimate's time, and a clock offset that the motion does not determine.
ReceiverScore score_by_receiver(const geometry::Trajectory& estimate, const ReceiverTruth& truth,
                                metrics::TrajectoryAlignment alignment, const ReceiverScoring& scoring,
                                const std::string& name);

/// The section `receiver` of metrics.json (docs/formats.md).
nlohmann::json to_json(const ReceiverScore& score, const ReceiverScoring& scoring);

}  // namespace tileflight::scoring
