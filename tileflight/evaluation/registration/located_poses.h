#pragma once

#include <vector>

#include "tileflight/core/alignment/similarity_chart.h"
#include "tileflight/evaluation/registration/similarity_estimate.h"

namespace tileflight::registration {

/// A camera pose of the map's path, with the pose located independently in the local frame for the same time.
struct LocatedPose {
  geometry::SE3 T_map_camera;
  geometry::SE3 T_local_camera;
  /// Information matrix of a small motion x of the located camera in its own axes, T_local_camera exp(x), translation
  /// (m) first, rotation (rad).
  Eigen::Matrix<double, 6, 6> information = Eigen::Matrix<double, 6, 6>::Identity();
};

struct LocatedPosesFit {
  SimilarityEstimate estimate;      ///< about the mean of the located positions
  std::vector<double> deviations;   ///< for each pose: Mahalanobis distance over its expectation (1: as stated), after
                                    ///< scaling the stated sigmas by `noise`
  std::vector<double> distances_m;  ///< distance of each located position from the transformed path
  std::vector<bool> is_inlier;      ///< within the noise
  double noise = 1.0;               ///< observed over stated sigma (robust)
  std::size_t inliers = 0;
};

/// Fits the similarity from the map's path to the located poses, including orientations, each weighted by its
/// information: Gauss-Newton on the pose logarithms with the Geman-McClure kernel. It starts from the best of the
/// similarities given by one pose and the scale to a second one, so that wrongly located poses do not decide. A pose is
/// an inlier within three sigmas of the noise estimated from the poses. `at_least_m`: path errors below this never
/// count as outliers. Throws InputError for fewer than two poses.
LocatedPosesFit fit_located_poses(const std::vector<LocatedPose>& poses, const geometry::Sim3& start,
                                  double at_least_m = 0.0);

/// Returns the similarity of located poses with equal weights: rotation by their mean, translation and scale by the
/// positions (core/alignment/umeyama.h). Throws InputError for an empty list.
geometry::Sim3 similarity_of(const std::vector<LocatedPose>& poses);

/// Distribution of located poses along their path.
enum class PathCoverage {
  kWhole,  ///< evenly spread over all of it
  kParts   ///< parts of it have no located pose
};

/// Standard deviation of similarity_of() `poses`, which are in the path's order, as displacement of the map's points
/// (metres, RMS over points and noise), against the similarity of all poses of the path, located without error. By
/// leaving out one interval of the path at a time, since neighbours share their errors:
///
/// - kParts: jackknife (core/alignment/uncertainty.h). A path that bends gives another similarity for each of its
/// parts.
/// - kWhole: a path that bends is the same in sample and whole, so the bend is no error, however much a leg of it
/// pulls.
///   The estimates' second differences leave out what changes slowly along the path (Wolter, Introduction to Variance
///   Estimation, 2nd edition, chapter 8: contrasts of a systematic sample), but also errors that are shared for longer.
///   Hence twice that, and at most the jackknife, which counts all. For fewer than eight poses as kParts.
///
/// NaN for fewer than four poses.
double similarity_sigma_m(const std::vector<LocatedPose>& poses, const alignment::PointSpread& points,
                          PathCoverage coverage);

}  // namespace tileflight::registration
