#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "tileflight/evaluation/normal_consistency.h"
#include "tileflight/geometry/mesh.h"
#include "tileflight/geometry/point_cloud.h"
#include "tileflight/geometry/trajectory.h"

namespace tileflight::evaluation {

/// Mean, spread and shape of a set of distances, metres. What too few distances leave undefined is NaN (null in JSON).
struct DistanceStatistics {
  std::size_t count = 0;
  double mean = std::numeric_limits<double>::quiet_NaN();
  double std = std::numeric_limits<double>::quiet_NaN();  ///< divisor n - 1
  double median = std::numeric_limits<double>::quiet_NaN();
  double rmse = std::numeric_limits<double>::quiet_NaN();
};

DistanceStatistics statistics_of(std::vector<double> distances);

/// By percentage, metres: half of the distances are at most percentiles[50]. Empty without distances.
using Percentiles = std::map<int, double>;

/// The 25th, 50th, 75th, 90th, 95th and 99th, linear between neighbours in order (Hyndman and Fan 1996, definition 7).
Percentiles percentiles_of(std::vector<double> distances);

struct Histogram {
  std::vector<double> edges;  ///< 51 of them for 50 bins from 0 to the cut-off
  std::vector<std::size_t> counts;
};

/// The paper's numbers (design: science.md): distance from each map point to the nearest voxel centre, kept up to the
/// cut-off.
struct MapMetrics {
  std::size_t points = 0;
  std::size_t correspondences = 0;
  DistanceStatistics distances;  ///< of the kept ones
  Percentiles percentiles;       ///< of the kept ones
  Histogram histogram;
  double cutoff_m = 1.0;
  DistanceStatistics quantization_floor;  ///< the score of points sampled on the true surface
};

/// Share of the distances up to each of a row of thresholds.
struct CumulativeCurve {
  std::vector<double> thresholds_m, shares;
};

/// At 61 thresholds from 0.01 to 10 m, evenly by their logarithm. Without distances: no shares.
CumulativeCurve cumulative_curve(const std::vector<double>& distances);

/// Distance to the exact surface, nothing cut off; shares by threshold.
struct SurfaceMetrics {
  DistanceStatistics distances;
  Percentiles percentiles;
  CumulativeCurve cumulative;
  std::optional<NormalConsistency> normals;  ///< where it was asked for
  std::map<double, double> accuracy, completeness,
      f_score;  ///< by threshold, metres; the last two empty where no surface was seen
};

struct RelativePoseError {
  double delta_m = 0;     ///< path length of the estimate between the two poses of a pair
  std::size_t pairs = 0;  ///< none: the path is too short, the errors are NaN
  double translation_rmse_m = std::numeric_limits<double>::quiet_NaN();
  double rotation_rmse_deg = std::numeric_limits<double>::quiet_NaN();
};

/// Mean error over sub-paths of one to eight stretches, by the distance flown; NaN where none fits.
struct PathDrift {
  double stretch_m = 0;
  std::size_t subpaths = 0;
  double translation_percent = std::numeric_limits<double>::quiet_NaN();
  double rotation_deg_per_m = std::numeric_limits<double>::quiet_NaN();
};

/// Deviation of the local scale (true over estimated length of a stretch, after the alignment) from 1.
struct ScaleDrift {
  double stretch_m = 0;
  std::size_t stretches = 0;  ///< none: the path has no length, the deviations are NaN
  double largest = std::numeric_limits<double>::quiet_NaN();
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

/// `surface_samples`: points evenly on the true surface, for the floor; none: no floor. Throws InputError: empty map or
/// truth, not finite.
MapMetrics evaluate_map(const geometry::PointCloud& aligned_map, const geometry::PointCloud& voxel_centers,
                        const geometry::PointCloud& surface_samples, const MapMetricsOptions& options = {});

/// `seen_samples`: samples of the true surface that the flight's camera saw, for completeness; none: no completeness.
/// Throws InputError as evaluate_map() does.
SurfaceMetrics evaluate_surface(const geometry::PointCloud& aligned_map, const geometry::TriangleMesh& surface,
                                const geometry::PointCloud& seen_samples,
                                const std::vector<double>& thresholds_m = {0.1, 0.2, 0.5, 1.0});

enum class TrajectoryAlignment { kSim3, kSE3, kNone };

/// ATE after alignment of the camera positions (Umeyama), RPE over the given path lengths. Poses are paired by time (10
/// ms). Definitions: Sturm et al., IROS 2012, sections V-A and V-B, on the aligned estimate; pairs of the RPE as evo
/// takes them: consecutive stretches of the estimate's path, each from the pose where the stretch before reached the
/// length. Throws InputError when fewer than 3 pairs share a time.
TrajectoryMetrics evaluate_trajectory(const geometry::Trajectory& estimate, const geometry::Trajectory& truth,
                                      TrajectoryAlignment alignment,
                                      const std::vector<double>& rpe_deltas_m = {1, 10, 50});

/// A difference of mean errors (simulated minus real) and what follows from its interval.
struct MeanDifference {
  double difference_m = std::numeric_limits<double>::quiet_NaN();
  std::array<double, 2> ci95{};
  std::string verdict = "undecided";          ///< as in Comparison
  std::optional<double> equivalent_within_m;  ///< as in Comparison
};

/// The two runs side by side by the paper's measure, whose floor hides what good maps differ in: what tells maps apart
/// is in map_comparison.h. Differences are simulated minus real.
struct Comparison {
  double mean_difference_m = 0, std_difference_m = 0, points_ratio = 0;
  double ks_statistic = 0, wasserstein_m = 0;
  std::array<double, 2> mean_difference_ci95{};
  double equivalence_margin_m = 0.05;
  /// "equivalent": the 90 % interval (two one-sided tests at 5 %, Schuirmann 1987) lies within the margin; "different":
  /// the 95 % interval lies outside it; else "undecided". On this measure alone.
  std::string verdict;
  std::optional<double> equivalent_within_m;  ///< the smallest margin at which they would count as equivalent
  std::size_t blocks = 0;                     ///< of the bootstrap; below 2 there is no interval and nothing is decided
  std::array<double, 2> share_kept{};         ///< of the map points, within the cut-off: simulated, real

  /// What the difference, its interval and the verdict are by: "blocks" of space within one run, or whole "runs".
  std::string unit = "blocks";
  std::array<std::size_t, 2> runs{1, 1};     ///< simulated, real
  std::optional<MeanDifference> within_run;  ///< by blocks, of the first runs, where the unit is runs
};

struct ComparisonOptions {
  double equivalence_margin_m = 0.05;
  double block_m = 5.0;  ///< edge of the blocks of the bootstrap
  int resamples = 2000;
  std::uint64_t seed = 1;
};

/// Kept distances of a run with the positions they belong to (blocks need them).
struct KeptDistances {
  std::vector<geometry::Vec3> positions;
  std::vector<double> distances;
  std::size_t points = 0;  ///< of the map, kept or not
};
/// Distances of the points that lie within the cut-off of a voxel centre.
KeptDistances kept_distances(const geometry::PointCloud& aligned_map, const geometry::PointCloud& voxel_centers,
                             double cutoff_m);

/// Interval by bootstrap over places: cubes of block_m, each with the points of both runs in it, are drawn with
/// replacement, since neighbours' errors are alike (and alike in both runs where the truth is coarse). Kuensch 1989;
/// Efron and Tibshirani, An Introduction to the Bootstrap, 1993. Deterministic. Throws InputError when a run has no
/// kept distance.
Comparison compare(const KeptDistances& simulated, const KeptDistances& real, const ComparisonOptions& options = {});

/// The same where flights were tracked more than once, the first runs in front. With two runs or more on each side that
/// were not all alike, a run is the unit: the difference is that of the means over the runs, the interval Welch's
/// (difference_of_runs()); all other numbers, and `within_run`, are of the first runs. The interval then tells how far
/// the odometry's own chance carries, not what another place would give; within_run tells the latter. Else compare() of
/// the first runs. Throws InputError when a run has no kept distance.
Comparison compare_runs(const std::vector<KeptDistances>& simulated, const std::vector<KeptDistances>& real,
                        const ComparisonOptions& options = {});

/// The keys of the contract.
nlohmann::json to_json(const MapMetrics& m);
nlohmann::json to_json(const SurfaceMetrics& m);
nlohmann::json to_json(const TrajectoryMetrics& m);
nlohmann::json to_json(const Comparison& c);  ///< without `verdict`, which is map_comparison.h's

}  // namespace tileflight::evaluation
