#pragma once

// Residual of the states at two instants against the samples between them, with derivatives.

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

/// Forster (45), and appendix C for the derivatives. `gravity_m_s2`: straight down the world's z axis.
InertialResidual inertial_residual(const Preintegration& between, const ImuState& first, const ImuState& second,
                                   double gravity_m_s2);

/// The state moved by a perturbation in the order above.
ImuState perturbed(const ImuState& state, const Eigen::Matrix<double, kStateSize, 1>& change);

/// The state after `between`, predicted from its samples: Forster (32).
ImuState predicted(const Preintegration& between, const ImuState& first, double gravity_m_s2);

}  // namespace tileflight::inertial
