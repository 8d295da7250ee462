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

#include "tileflight/evaluation/normal_consistency.h"
#include "tileflight/geometry/mesh.h"
#include "tileflight/geometry/point_cloud.h"
#include "tileflight/geometry/trajectory.h"

namespace tileflight::evaluation {

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

/// Cumulative share of distances by threshold.
struct CumulativeCurve {
  std::vector<double> thresholds_m, shares;
};

/// At 61 thresholds from 0.01 to 10 m, evenly spaced in the logarithm. No shares without distances.
CumulativeCurve cumulative_curve(const std::vector<double>& distances);

/// Distances to the exact surface, without cut-off, and shares by threshold.
struct SurfaceMetrics {
  DistanceStatistics distances;
  Percentiles percentiles;
  CumulativeCurve cumulative;
  std::optional<NormalConsistency> normals;  ///< if requested
  std::map<double, double> accuracy, completeness,
      f_score;  ///< shares by threshold, metres; the last two are empty if no surface was seen
};

struct RelativePoseError {
  double delta_m = 0;     ///< path length of the estimate between the two poses of a pair
  std::size_t pairs = 0;  ///< 0: the path is too short and the errors are NaN
  double translation_rmse_m = std::numeric_limits<double>::quiet_NaN();
  double rotation_rmse_deg = std::numeric_limits<double>::quiet_NaN();
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

struct TrajectoryMetrics {
  double ate_rmse_m = 0, ate_mean_m = 0, ate_max_m = 0;
  std::vector<RelativePoseError> rpe;
  PathDrift drift;
  ScaleDrift scale_drift;
  double path_length_m = 0;  ///< of the truth over the compared poses
  double scale = 1;          ///< of the Sim(3) that aligned the estimate
  std::size_t poses = 0;
};

struct MapMetricsOptions {
  double cutoff_m = 1.0;
  int bins = 50;
};

enum class TrajectoryAlignment { kSim3, kSE3, kNone };

/// ATE after alignment of the camera positions (Umeyama), RPE over the given path lengths. Poses are paired by time
/// (tolerance 10 ms). Definitions: Sturm et al., IROS 2012, sections V-A and V-B, on the aligned estimate; pairs of the
/// RPE as in evo: consecutive segments of the estimate's path, each starting at the pose where the previous one reached
/// the length. Throws InputError for fewer than 3 pairs.
TrajectoryMetrics evaluate_trajectory(const geometry::Trajectory& estimate, const geometry::Trajectory& truth,
                                      TrajectoryAlignment alignment,
                                      const std::vector<double>& rpe_deltas_m = {1, 10, 50});

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

/// Interval by spatial block bootstrap: cubes of block_m, each with the points of both runs in it, are drawn with
/// replacement, since errors of neighbours are correlated (also between the runs where the truth is coarse). Kuensch
/// 1989; Efron and Tibshirani, An Introduction to the Bootstrap, 1993. Deterministic. Throws InputError if a run has no
/// kept distance.
DistanceComparison compare_distances(const KeptDistances& simulated, const KeptDistances& real,
                                     const DistanceComparisonOptions& options = {});

/// Same for flights tracked more than once. With at least two differing runs on each side the sampling unit is a run:
/// the difference is that of the means over the runs, with Welch's interval (welch_difference()); all other numbers,
/// and `within_run`, are of the first runs. The interval then covers the randomness of the odometry, not the choice of
/// the place; `within_run` covers the latter. Otherwise compare_distances() of the first runs. Throws InputError if a
/// run has no kept distance.
DistanceComparison compare_runs(const std::vector<KeptDistances>& simulated, const std::vector<KeptDistances>& real,
                                const DistanceComparisonOptions& options = {});

/// The keys of metrics.json and of comparisons.
nlohmann::json to_json(const MapMetrics& m);
nlohmann::json to_json(const SurfaceMetrics& m);
nlohmann::json to_json(const TrajectoryMetrics& m);
nlohmann::json to_json(const DistanceComparison& c);  ///< without `verdict`, which map_comparison.h adds

}  // namespace tileflight::evaluation
