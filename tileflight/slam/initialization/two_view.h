#pragma once

// Relative pose of two images from pairs of unit rays, for any lens.
//
// x_b lambda_b = R x_a lambda_a + t. Near-planar scenes fit a homography, whose decomposition has two physically
// possible solutions (Faugeras and Lustman 1988; Longuet-Higgins 1986). Both are returned; more images are needed to
// choose.

#include <cstdint>
#include <vector>

#include "tileflight/core/geometry/transform.h"

namespace tileflight::initialization {

struct RayPair {
  geometry::Vec3 a;  ///< unit
  geometry::Vec3 b;  ///< unit
};

/// Essential matrices of exactly five pairs (Stewenius, Engels, Nister, ISPRS J. 60(4), 2006): up to ten.
std::vector<geometry::Mat3> solve_five_point(const std::vector<RayPair>& pairs);

/// H with x_b ~ H x_a of four pairs or more (direct linear transform), scaled to a middle singular value of 1 and x_b^T
/// H x_a > 0.
geometry::Mat3 fit_homography(const std::vector<RayPair>& pairs);

/// Poses (unit translation) from H = R + t n^T / d with the points in front of both cameras: in general two for a plane
/// (Ma, Soatto, Kosecka, Sastry, An Invitation to 3-D Vision, section 5.3.3).
std::vector<geometry::SE3> poses_from_homography(const geometry::Mat3& H, const std::vector<RayPair>& pairs);

/// Returns the pose of an essential matrix, of its four, that has the most points in front of both cameras. Unit
/// translation.
geometry::SE3 pose_from_essential(const geometry::Mat3& E, const std::vector<RayPair>& pairs);

/// Returns the Sampson distance of a pair to the epipolar geometry, radians.
double epipolar_distance_rad(const geometry::Mat3& E, const RayPair& pair);

/// Returns the inverse distance along ray a at which the pair's rays are closest to each other.
double triangulate_inverse_distance(const geometry::SE3& T_b_a, const RayPair& pair);

/// Returns distinct candidates for T_b_a (unit translation), by random sampling of both models, the best of each model
/// first. `threshold_rad`: largest error of an inlier.
std::vector<geometry::SE3> relative_pose_candidates(const std::vector<RayPair>& pairs, double threshold_rad,
                                                    std::uint32_t seed);

/// Best rotation from rays a to rays b, without the worst pairs, and the median remaining angle.
struct RotationFit {
  Eigen::Quaterniond R_b_a = Eigen::Quaterniond::Identity();
  double median_rad = 0.0;
};
RotationFit fit_rotation(const std::vector<RayPair>& pairs);

}  // namespace tileflight::initialization
