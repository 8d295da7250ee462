#pragma once

#include <optional>
#include <vector>

#include "tileflight/core/alignment/similarity_chart.h"
#include "tileflight/evaluation/registration/similarity_estimate.h"

namespace tileflight::registration {

/// Holds what a part of an image contributed to the pose that was located by it.
struct PosePart {
  geometry::Vec3 point_local;  ///< middle of the surface that the part shows, metres
  double size_m = 0.0;         ///< of that surface, seen from the camera
  /// States the motion x of the camera, T_local_camera exp(x), translation (m) first, rotation (rad), by which the
  /// part's residuals moved the pose; enlarged for the residuals that the pose itself has fitted. Those of all parts
  /// nearly cancel.
  geometry::Vec6 motion = geometry::Vec6::Zero();
};

/// A camera pose of the map's path, with the pose located independently in the local frame for the same time.
struct LocatedPose {
  geometry::SE3 T_map_camera;
  geometry::SE3 T_local_camera;
  /// Information matrix of a small motion x of the located camera in its own axes, T_local_camera exp(x), translation
  /// (m) first, rotation (rad).
  Eigen::Matrix<double, 6, 6> information = Eigen::Matrix<double, 6, 6>::Identity();
  std::vector<PosePart> parts{};  ///< empty: unknown
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

/// Returns the covariance of similarity_of() `poses`, which are in the path's order, as a motion about `center` (target
/// frame), against the similarity of all poses of the path, located without error. It leaves out one interval of the
/// path at a time, since neighbours share their errors:
///
/// - kParts: jackknife (core/alignment/uncertainty.h). A path that bends gives another similarity for each of its
///   parts.
/// - kWhole: a path that bends is the same in sample and whole, so the bend is no error, however much a leg of it
///   pulls. The estimates' second differences leave out what changes slowly along the path (Wolter, Introduction to
///   Variance Estimation, 2nd edition, chapter 8: contrasts of a systematic sample), but also errors that are shared
///   for longer. Hence four times that variance, and at most the jackknife, which counts all: the one that moves
///   `points` (of the map) less. For fewer than eight poses as kParts.
///
/// nullopt for fewer than four poses.
std::optional<Mat7> interval_covariance(const std::vector<LocatedPose>& poses, const geometry::Vec3& center,
                                        const alignment::PointSpread& points, PathCoverage coverage);

/// Returns the covariance of similarity_of() `poses` by what the images show, as a motion about `center`: a place that
/// has changed pulls all images of the same ground in the same way, which no difference between the poses tells. The
/// contributions of the images' parts are summed over the blocks of ground that they show, and are independent between
/// blocks (Liang and Zeger, Biometrika 73, 1986). Zero if the poses have no parts.
Mat7 ground_covariance(const std::vector<LocatedPose>& poses, const geometry::Vec3& center);

/// Returns the similarity of located poses with its information: the inverse of the sum of the covariances above, about
/// the mean of the poses. nullopt for fewer than four poses.
std::optional<SimilarityEstimate> estimate_similarity(const std::vector<LocatedPose>& poses,
                                                      const alignment::PointSpread& points, PathCoverage coverage);

}  // namespace tileflight::registration
