#pragma once

// Relative pose of two pictures from pairs of unit rays, for any lens.
//
// x_b lambda_b = R x_a lambda_a + t. Near-planar scenes fit a homography, whose decomposition has two physically
// possible answers (Faugeras and Lustman 1988; Longuet-Higgins 1986): both are returned, more pictures must decide.

#include <cstdint>
#include <vector>

#include "tileflight/geometry/transform.h"

namespace tileflight::odometry {

struct RayPair {
  geometry::Vec3 a;  ///< unit
  geometry::Vec3 b;  ///< unit
};

/// Essential matrices of exactly five pairs (Stewenius, Engels, Nister, ISPRS J. 60(4), 2006): up to ten.
std::vector<geometry::Mat3> essential_from_five(const std::vector<RayPair>& pairs);

/// H with x_b ~ H x_a of four pairs or more (direct linear transform), scaled to a middle singular value of 1 and x_b^T
/// H x_a > 0.
geometry::Mat3 homography_from(const std::vector<RayPair>& pairs);

/// The poses (unit translation) that H = R + t n^T / d allows with the pairs' points in front: two for a plane in
/// general (Ma, Soatto, Kosecka, Sastry, An Invitation to 3-D Vision, section 5.3.3).
std::vector<geometry::SE3> poses_from_homography(const geometry::Mat3& H, const std::vector<RayPair>& pairs);

/// The pose of an essential matrix that has most pairs in front of both cameras. Unit translation.
geometry::SE3 pose_from_essential(const geometry::Mat3& E, const std::vector<RayPair>& pairs);

/// Sampson distance of a pair to the epipolar geometry, radians.
double epipolar_distance_rad(const geometry::Mat3& E, const RayPair& pair);

/// Inverse distance along x_a that brings the pair's rays nearest to each other.
double inverse_distance(const geometry::SE3& T_b_a, const RayPair& pair);

/// Candidates for T_b_a (unit translation) by random samples of both models; different from each other; the most
/// probable of each model first. `threshold_rad`: an inlier's largest error.
std::vector<geometry::SE3> relative_pose_candidates(const std::vector<RayPair>& pairs, double threshold_rad,
                                                    std::uint32_t seed);

/// The rotation that takes a to b best, without the worst pairs, and the median angle that is left.
struct RotationFit {
  Eigen::Quaterniond R_b_a = Eigen::Quaterniond::Identity();
  double median_rad = 0.0;
};
RotationFit fit_rotation(const std::vector<RayPair>& pairs);

}  // namespace tileflight::odometry
