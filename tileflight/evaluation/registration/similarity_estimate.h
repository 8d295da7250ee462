#pragma once

#include <Eigen/Core>

#include "tileflight/core/alignment/similarity_chart.h"
#include "tileflight/core/geometry/transform.h"

namespace tileflight::registration {

using Mat7 = Eigen::Matrix<double, 7, 7>;

/// Motion from similarity `reference` to `T`, to first order about `center` (target frame): translation of the centre
/// (m), rotation vector (rad), logarithm of the scale. Zero for equal similarities.
geometry::Vec7 motion_between(const geometry::Sim3& reference, const geometry::Sim3& T, const geometry::Vec3& center);

/// Applies a motion after `T`: inverse of motion_between() to first order, exact for a zero motion.
geometry::Sim3 apply_motion(const geometry::Sim3& T, const geometry::Vec7& motion, const geometry::Vec3& center);

/// A similarity (map to local) with its uncertainty: the error is a motion about `center` (motion_between()) with this
/// information matrix (inverse covariance); zero for unknown directions.
struct SimilarityEstimate {
  geometry::Sim3 T_target_source;
  geometry::Vec3 center = geometry::Vec3::Zero();  ///< target frame
  Mat7 information = Mat7::Zero();

  /// Returns the estimate expressed about another centre.
  SimilarityEstimate recentered(const geometry::Vec3& new_center) const;
};

/// Returns the standard deviation of the points by the covariance of a motion of `T` about `center` (target frame):
/// metres, RMS over points and noise. `points`: in the source frame.
double motion_sigma_m(const Mat7& covariance, const geometry::Sim3& T, const geometry::Vec3& center,
                      const alignment::PointSpread& points);

}  // namespace tileflight::registration
