#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <map>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <vector>

#include "tileflight/core/geometry/mesh.h"
#include "tileflight/core/geometry/point_cloud.h"
#include "tileflight/core/geometry/trajectory.h"
#include "tileflight/evaluation/metrics/normal_consistency.h"

namespace tileflight::metrics {

/// Statistics of a set of distances, metres. Values undefined for too few distances are NaN (null in JSON).
struct DistanceStatistics {
  std::size_t count = 0;
  double mean = std::numeric_limits<double>::quiet_NaN();
  double std = std::numeric_limits<double>::quiet_NaN();  ///< divisor n - 1
  double median = std::numeric_limits<double>::quiet_NaN();
  double rmse = std::numeric_limits<double>::quiet_NaN();
};

DistanceStatistics compute_statistics(std::vector<double> distances);

/// Percentiles by percentage, metres: half of the distances are at most percentiles[50]. Empty without distances.
using Percentiles = std::map<int, double>;

/// The 25th, 50th, 75th, 90th, 95th and 99th percentiles, linearly interpolated (Hyndman and Fan 1996, definition 7).
Percentiles compute_percentiles(std::vector<double> distances);

struct Histogram {
  std::vector<double> edges;  ///< 51 edges for 50 bins from 0 to the cut-off
  std::vector<std::size_t> counts;
};

/// The paper's metrics (docs/algorithms.md): distance from each map point to the nearest voxel centre, kept up to the
/// cut-off.
struct MapMetrics {
  std::size_t points = 0;
  std::size_t correspondences = 0;
  DistanceStatistics distances;  ///< of the kept ones
  Percentiles percentiles;       ///< of the kept ones
  Histogram histogram;
  double cutoff_m = 1.0;
  DistanceStatistics quantization_floor;  ///< statistics of points sampled on the true surface
};

/// Shares by tolerance, as the benchmark ETH3D draws them: Schöps et al., CVPR 2017, section 4.
struct CumulativeCurve {
  std::vector<double> thresholds_m;
  std::vector<double> shares;                 ///< accuracy: of the map points within each threshold
  std::vector<double> completeness, f_score;  ///< as in SurfaceMetrics; empty if no surface was seen
};

/// Computes the curve at 61 thresholds from 0.01 to 10 m, evenly spaced in the logarithm. It has no shares without
/// distances, no completeness and no F-score without distances of samples of the surface.
CumulativeCurve cumulative_curve(const std::vector<double>& distances,
                                 const std::vector<double>& sample_distances = {});

/// Returns the area under the polygon through the points (ln t, share), over the range of ln t: 1 for shares of 1, and
/// equal weight for equal ratios of tolerances. NaN for fewer than two points.
double area_under_curve(const std::vector<double>& thresholds_m, const std::vector<double>& shares);

/// Distances to the exact surface, without cut-off, and shares by threshold.
struct SurfaceMetrics {
  DistanceStatistics distances;
  Percentiles percentiles;
  CumulativeCurve cumulative;
  std::optional<NormalConsistency> normals;  ///< if requested
  std::map<double, double> accuracy, completeness,
      f_score;  ///< shares by threshold, metres; the last two are empty if no surface was seen
};

/// Distribution of the errors of a trajectory's poses, in their unit. The standard deviation has the divisor n, as
/// evo's, so that rmse^2 = mean^2 + std^2. NaN without errors.
struct PoseErrorSpread {
  double mean = std::numeric_limits<double>::quiet_NaN();
  double median = std::numeric_limits<double>::quiet_NaN();
  double std = std::numeric_limits<double>::quiet_NaN();
  double min = std::numeric_limits<double>::quiet_NaN();
  double max = std::numeric_limits<double>::quiet_NaN();
};

/// Error of the motion between the two poses of a pair, which are a path length or a number of frames apart.
struct RelativePoseError {
  double delta_m = 0;            ///< path length of the estimate between the two poses of a pair; 0: by frames
  std::size_t delta_frames = 0;  ///< steps from pose to pose between the two; 0: by path length
  std::size_t pairs = 0;         ///< 0: the path is too short and the errors are NaN
  double translation_rmse_m = std::numeric_limits<double>::quiet_NaN();
  double rotation_rmse_deg = std::numeric_limits<double>::quiet_NaN();
  PoseErrorSpread translation_m, rotation_deg;
};

/// Mean error per distance flown, over sub-paths of one to eight segments; NaN if none fits.
struct PathDrift {
  double segment_length_m = 0;
  std::size_t subpaths = 0;
  double translation_percent = std::numeric_limits<double>::quiet_NaN();
  double rotation_deg_per_m = std::numeric_limits<double>::quiet_NaN();
};

/// Deviation of the local scale (true over estimated length of a segment, after alignment) from 1.
struct ScaleDrift {
  double segment_length_m = 0;
  std::size_t segments = 0;  ///< 0: the path has no length and the deviations are NaN
  double max_deviation = std::numeric_limits<double>::quiet_NaN();
  double rms = std::numeric_limits<double>::quiet_NaN();
};

/// Selects the transform that aligns an estimated trajectory to the true one: Sim(3), SE(3) without scale, or none.
enum class TrajectoryAlignment { kSim3, kSE3, kNone };

/// Returns "sim3", "se3" or "none", as in files and options.
const char* name_of(TrajectoryAlignment alignment);

/// States how much of a trajectory's error is that of the receiver whose positions are the truth.
struct ReceiverError {
  double horizontal_sigma_m = 0.0;  ///< RMS of the positions' standard deviations, each horizontal axis
  double vertical_sigma_m = 0.0;
  double expected_rmse_m = 0.0;             ///< error of a perfect trajectory, by these standard deviations
  std::optional<double> beyond_receiver_m;  ///< RMS of the error that the receiver does not explain; nullopt: none
  double normalized_error_squared = 0.0;  ///< mean of the squared errors over their variances, each axis; 1: as stated
  double time_offset_s = 0.0;             ///< added to the estimate's times to get the receiver's
  double time_offset_sigma_s = 0.0;       ///< 0: not estimated
  geometry::Vec3 lever_arm_m = geometry::Vec3::Zero();  ///< of the antenna in the camera: right, down, forward
};

struct TrajectoryMetrics {
  double ate_rmse_m = 0, ate_mean_m = 0, ate_max_m = 0;
  double ate_median_m = std::numeric_limits<double>::quiet_NaN();  ///< NaN in older files, as the next two
  double ate_std_m = std::numeric_limits<double>::quiet_NaN();     ///< divisor n, as PoseErrorSpread
  double ate_min_m = std::numeric_limits<double>::quiet_NaN();
  std::optional<TrajectoryAlignment> alignment;  ///< unknown in older files
  std::vector<RelativePoseError> rpe;            ///< by path length
  std::vector<RelativePoseError> rpe_frames;     ///< by number of frames
  PathDrift drift;
  ScaleDrift scale_drift;
  double path_length_m = 0;                                        ///< of the truth over the compared poses
  double scale = 1;                                                ///< of the Sim(3) that aligned the estimate
  std::size_t poses = 0;                                           ///< compared, each with a true one
  std::size_t estimated_poses = 0, true_poses = 0;                 ///< given; 0 in older files
  double time_covered = std::numeric_limits<double>::quiet_NaN();  ///< share of the truth's time between the first and
                                                                   ///< the last pair, without gaps
  /// Present if the truth is a receiver's positions. Receivers measure no rotations: their errors are written as null.
  std::optional<ReceiverError> receiver;
};

struct MapMetricsOptions {
  double cutoff_m = 1.0;
  int bins = 50;
};

/// Selects how estimated and true poses are paired.
enum class TrajectoryPairing {
  kByTime,   ///< nearest in time
  kByIndex,  ///< the first with the first, and so on: for files without times
};

struct TrajectoryOptions {
  TrajectoryAlignment alignment = TrajectoryAlignment::kSim3;
  std::vector<double> rpe_deltas_m = {1, 10, 50};
  std::vector<std::size_t> rpe_deltas_frames = {1, 10};
  TrajectoryPairing pairing = TrajectoryPairing::kByTime;
  double max_time_difference_s = 0.01;  ///< between the two poses of a pair
};

/// Holds a time without poses in the middle of a trajectory.
struct TimeGap {
  double from_s = 0.0, to_s = 0.0;
  double missing_s = 0.0;  ///< of it, without what was not recorded at all
};

/// Finds the gaps of a trajectory: intervals between poses that are far longer than usual, and longer than a share of
/// `duration_s`. Keyframes, which are made as the view changes, are not so far apart. Times in `unrecorded`, the gaps
/// of the images or of the true poses, do not count.
std::vector<TimeGap> find_time_gaps(const geometry::Trajectory& trajectory, double duration_s,
                                    const std::vector<TimeGap>& unrecorded = {});

/// Estimated and true poses that correspond by index.
struct PairedTrajectories {
  geometry::Trajectory estimate, truth;
  std::size_t estimated_poses = 0, true_poses = 0;  ///< before pairing
  double true_duration_s = 0;                       ///< of all true poses
  std::vector<TimeGap> unrecorded;                  ///< gaps of the true poses
  geometry::Sim3 T_truth_estimate;                  ///< applied to the estimate already
};

/// Pairs the poses and aligns the estimate's positions to the true ones (Umeyama, TPAMI 1991). Throws InputError for
/// fewer than 3 pairs, numbers of poses that differ if paired by index, positions that are not finite, and an estimate
/// that does not move.
PairedTrajectories pair_and_align(const geometry::Trajectory& estimate, const geometry::Trajectory& truth,
                                  const TrajectoryOptions& options = {});

/// Scores aligned pairs: ATE of the camera positions, RPE over path lengths and over numbers of frames, and drift.
/// Definitions: Sturm et al., IROS 2012, sections V-A and V-B, on the aligned estimate. Pairs of the RPE are as in evo:
/// the end of one is the start of the next. By path length, each pair ends at the pose where the estimate's path has
/// reached the length. Throws InputError for a length or a number of frames that is not positive.
TrajectoryMetrics score_trajectory(const PairedTrajectories& poses, const TrajectoryOptions& options = {});

/// Pairs, aligns and scores a trajectory: pair_and_align(), then score_trajectory().
TrajectoryMetrics evaluate_trajectory(const geometry::Trajectory& estimate, const geometry::Trajectory& truth,
                                      const TrajectoryOptions& options = {});

/// Error of the motion from each pose to the next (the first pose has none), as the RPE over one frame.
struct StepErrors {
  std::vector<double> translation_m, rotation_deg;
};
StepErrors compute_step_errors(const PairedTrajectories& poses);

/// A difference of mean errors (simulated minus real) with its interval and verdict.
struct MeanDifference {
  double difference_m = std::numeric_limits<double>::quiet_NaN();
  std::array<double, 2> ci95{};
  std::string verdict = "undecided";          ///< as in DistanceComparison
  std::optional<double> equivalent_within_m;  ///< as in DistanceComparison
};

/// Comparison of two runs by the paper's metric. Its quantisation floor hides differences between good maps;
/// map_comparison.h has metrics that show them. Differences are simulated minus real.
struct DistanceComparison {
  double mean_difference_m = 0, std_difference_m = 0, points_ratio = 0;
  double ks_statistic = 0, wasserstein_m = 0;
  std::array<double, 2> mean_difference_ci95{};
  double equivalence_margin_m = 0.05;
  /// "equivalent": the 90 % interval (two one-sided tests at 5 %, Schuirmann 1987) lies within the margin; "different":
  /// the 95 % interval lies outside it; else "undecided". By this metric alone.
  std::string verdict;
  std::optional<double> equivalent_within_m;  ///< smallest margin at which the verdict would be "equivalent"
  std::size_t blocks = 0;                     ///< blocks of the bootstrap; below 2 there is no interval and no verdict
  std::array<double, 2> share_kept{};         ///< share of the map points within the cut-off: simulated, real

  /// Sampling unit of the interval and the verdict: "blocks" of space within one run, or whole "runs".
  std::string sampling_unit = "blocks";
  std::array<std::size_t, 2> runs{1, 1};     ///< simulated, real
  std::optional<MeanDifference> within_run;  ///< by blocks of the first runs, if the unit is runs
};

struct DistanceComparisonOptions {
  double equivalence_margin_m = 0.05;
  double block_m = 5.0;  ///< edge of the blocks of the bootstrap
  int resamples = 2000;
  std::uint64_t seed = 1;
};

/// Distances of a run within the cut-off, with their positions (needed for blocks).
struct KeptDistances {
  std::vector<geometry::Vec3> positions;
  std::vector<double> distances;
  std::size_t points = 0;  ///< all points of the map, kept or not
};

/// Compares two runs by the paper's metric, with an interval by spatial block bootstrap. Cubes of block_m, each with
/// the points of both runs in it, are drawn with replacement, since errors of neighbours are correlated (also between
/// the runs where the truth is coarse). Kuensch 1989; Efron and Tibshirani, An Introduction to the Bootstrap, 1993.
/// Deterministic. Throws InputError if a run has no kept distance.
DistanceComparison compare_distances(const KeptDistances& simulated, const KeptDistances& real,
                                     const DistanceComparisonOptions& options = {});

/// Compares two flights that were tracked more than once. With at least two differing runs on each side the sampling
/// unit is a run: the difference is that of the means over the runs, with Welch's interval (welch_difference()). All
/// other numbers, and `within_run`, are of the first runs. The interval then covers the randomness of the odometry, and
/// `within_run` that of the place. Otherwise the result is that of compare_distances() for the first runs. Throws
/// InputError if a run has no kept distance.
DistanceComparison compare_runs(const std::vector<KeptDistances>& simulated, const std::vector<KeptDistances>& real,
                                const DistanceComparisonOptions& options = {});

/// Return the keys of metrics.json and of comparisons.
nlohmann::json to_json(const MapMetrics& m);
nlohmann::json to_json(const SurfaceMetrics& m);
nlohmann::json to_json(const TrajectoryMetrics& m);
nlohmann::json to_json(const DistanceComparison& c);  ///< without `verdict`, which map_comparison.h adds

}  // namespace tileflight::metrics
