#pragma once

// Residuals of an inertial unit's states at two keyframes, with derivatives: against the unit's samples between them
// (inertial_residual()), and against the camera's odometry (visual_residual()).

#include "tileflight/slam/inertial/preintegration.h"

namespace tileflight::inertial {

/// State of the unit at an instant. The world's z axis points up.
struct ImuState {
  geometry::SE3 T_world_imu;
  geometry::Vec3 velocity_m_s = geometry::Vec3::Zero();  ///< in the world's axes
  geometry::ImuBias bias;
};

/// Order of a state's perturbation: rotation (right: R exp(d)), then additive position, velocity, gyroscope's and
/// accelerometer's bias.
constexpr int kRotation = 0, kPosition = 3, kVelocity = 6, kGyroscopeBias = 9, kAccelerometerBias = 12;
constexpr int kStateSize = 15;

using Mat915 = Eigen::Matrix<double, 9, kStateSize>;

/// Residual (rotation, velocity, position; its covariance is the preintegration's) with its derivatives.
struct InertialResidual {
  Eigen::Matrix<double, 9, 1> value;
  Mat915 by_first, by_second;
};

/// Computes the residual of two states against the samples between them: Forster (45), and appendix C for the
/// derivatives. `gravity_m_s2`: straight down the world's z axis.
InertialResidual inertial_residual(const Preintegration& between, const ImuState& first, const ImuState& second,
                                   double gravity_m_s2);

/// Returns the state moved by a perturbation in the order above.
ImuState perturbed(const ImuState& state, const Eigen::Matrix<double, kStateSize, 1>& change);

/// Predicts the state after `between` from its samples: Forster (32).
ImuState predicted(const Preintegration& between, const ImuState& first, double gravity_m_s2);

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

/// Mean readings of the unit about an instant.
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
