#pragma once

#include <Eigen/Core>
#include <vector>

#include "tileflight/geometry/transform.h"

namespace tileflight::alignment {

using Mat7 = Eigen::Matrix<double, 7, 7>;

/// How similarity `T` moves the target's points beyond `reference`, to first order about `center` (target frame):
/// translation of the center (m), rotation vector (rad), logarithm of the scale. Zero for equal similarities.
geometry::Vec7 motion_between(const geometry::Sim3& reference, const geometry::Sim3& T, const geometry::Vec3& center);

/// `T` with the motion applied after it: the inverse of motion_between() to first order, exact for motion zero.
geometry::Sim3 moved_by(const geometry::Sim3& T, const geometry::Vec7& motion, const geometry::Vec3& center);

/// A similarity (map to local) and how much is known of it: the error is a motion about `center` (motion_between())
/// with this information matrix, the inverse of its covariance; zero for what is not known at all.
struct SimilarityEstimate {
  geometry::Sim3 T_target_source;
  geometry::Vec3 center = geometry::Vec3::Zero();  ///< target frame
  Mat7 information = Mat7::Zero();

  /// The same knowledge about another centre: rotation and stretch about the old one move the new one.
  SimilarityEstimate about(const geometry::Vec3& new_center) const;
};

/// Maximum likelihood of independent estimates near one another, about the first one's centre. Not for an empty list.
SimilarityEstimate fused(const std::vector<SimilarityEstimate>& estimates);

/// Squared Mahalanobis distance between two estimates: of seven degrees of freedom where all is known to both, less
/// where `freedom` says so (directions that either does not know do not count).
struct Disagreement {
  double squared = 0.0;
  int freedom = 0;
  geometry::Vec7 motion = geometry::Vec7::Zero();  ///< from the first to the second, about the first's centre
};
Disagreement disagreement(const SimilarityEstimate& a, const SimilarityEstimate& b);

}  // namespace tileflight::alignment
