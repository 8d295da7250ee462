#pragma once

#include <vector>

#include "tileflight/alignment/similarity_estimate.h"

namespace tileflight::alignment {

/// A pose of the map's path, and where the same moment's camera was found in the local frame by other means.
struct LocatedPose {
  geometry::SE3 T_map_camera;
  geometry::SE3 T_local_camera;
  /// Of a small motion of the found camera in its own axes, T_local_camera exp(x), translation (m) first.
  Eigen::Matrix<double, 6, 6> information = Eigen::Matrix<double, 6, 6>::Identity();
};

struct LocatedPosesFit {
  SimilarityEstimate estimate;      ///< about the mean of the found positions
  std::vector<double> deviations;   ///< of each pose: Mahalanobis distance over its expectation (1: as stated), after
                                    ///< the stated sigmas were scaled by `noise`
  std::vector<double> distances_m;  ///< of each found position from the path's as carried over
  std::vector<bool> agrees;         ///< within the noise
  double noise = 1.0;               ///< observed over stated sigma (robust)
  std::size_t agreeing = 0;
};

/// The similarity that carries the map's path to the found poses, turns included, each by its information: Gauss-Newton
/// on the poses' logarithms with the kernel of Geman and McClure, from the best of the similarities that one pose
/// and the scale to another one give (so that poses found wrongly do not decide). A pose agrees where it is within
/// three sigmas of the noise that the poses themselves show. `at_least_m`: path's errors below it are never taken for
/// disagreement. Needs two poses; throws InputError for fewer.
LocatedPosesFit fit_located_poses(const std::vector<LocatedPose>& poses, const geometry::Sim3& start,
                                  double at_least_m = 0.0);

}  // namespace tileflight::alignment
