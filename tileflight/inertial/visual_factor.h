#pragma once

// Residual of an inertial unit's states at two keyframes against the camera's odometry, with derivatives.

#include "tileflight/inertial/inertial_factor.h"

namespace tileflight::inertial {

using Mat6 = Eigen::Matrix<double, 6, 6>;

/// The camera's motion between two keyframes, in the map's units.
struct VisualStep {
  geometry::SE3 T_first_second;    ///< camera poses
  Mat6 covariance = Mat6::Zero();  ///< of its right twist, translation first
};

/// Residual (right twist of the step: translation in map units, rotation in radians) with its derivatives.
struct VisualResidual {
  geometry::Vec6 value;
  Eigen::Matrix<double, 6, kStateSize> by_first, by_second;
  geometry::Vec6 by_log_scale;              ///< of metres per map unit
  Eigen::Matrix<double, 6, 3> by_mounting;  ///< right perturbation of R_imu_camera; the camera's place is kept
};

/// `log_scale`: logarithm of the metres per map unit.
VisualResidual visual_residual(const VisualStep& step, const ImuState& first, const ImuState& second,
                               const geometry::SE3& T_imu_camera, double log_scale);

}  // namespace tileflight::inertial
