#pragma once

// Residual of an inertial unit's states at two keyframes against the camera's odometry, with derivatives.

#include "tileflight/slam/inertial/inertial_factor.h"

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

/// What the unit reads about an instant, mean.
struct MeanReading {
  geometry::Vec3 angular_rate_rad_s = geometry::Vec3::Zero();
  geometry::Vec3 specific_force_m_s2 = geometry::Vec3::Zero();
  double half_s = 0.0;  ///< it is the mean over so long before and after
};

/// A state some time later, with the derivatives of its pose (rotation as a right perturbation, then position).
struct LaterState {
  ImuState state;
  Eigen::Matrix<double, 6, kStateSize> by_state;
  geometry::Vec6 by_time;
};

/// The state `later_s` seconds later (negative: before), for a short time in which turning rate and acceleration are
/// those of `reading`. `gravity_m_s2`: straight down the world's z axis.
LaterState moved_on(const ImuState& state, const MeanReading& reading, double later_s, double gravity_m_s2);

/// `log_scale`: logarithm of the metres per map unit.
VisualResidual visual_residual(const VisualStep& step, const ImuState& first, const ImuState& second,
                               const geometry::SE3& T_imu_camera, double log_scale);

}  // namespace tileflight::inertial
