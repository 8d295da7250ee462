#pragma once

// Preintegration of an inertial unit's samples between two instants: Forster, Carlone, Dellaert, Scaramuzza,
// "On-Manifold Preintegration for Real-Time Visual-Inertial Odometry", IEEE TRO 33(1), 2017. "Forster" with a number is
// an equation of that paper. Instead of its Euler steps (31), each step takes the mean reading and the attitude in its
// middle, so that the error falls with the square of the sample time.

#include <optional>
#include <span>

#include "tileflight/slam/inertial/imu_samples.h"

namespace tileflight::inertial {

using Mat9 = Eigen::Matrix<double, 9, 9>;
using Mat93 = Eigen::Matrix<double, 9, 3>;

/// Motion from i to j, free of gravity and of the state at i: Forster (33).
struct Increment {
  Eigen::Quaterniond rotation = Eigen::Quaterniond::Identity();  ///< R_i_j
  geometry::Vec3 velocity = geometry::Vec3::Zero();              ///< R_i^T (v_j - v_i - g dt), m/s
  geometry::Vec3 position = geometry::Vec3::Zero();              ///< R_i^T (p_j - p_i - v_i dt - g dt^2 / 2), m
};

/// Samples between two instants, integrated with given biases. Errors and derivatives are ordered rotation (right
/// perturbation, radians), velocity, position.
struct Preintegration {
  double duration_s = 0.0;
  geometry::ImuBias bias;                   ///< with which it was integrated
  Increment increment;                      ///< Forster (35) to (37)
  Mat9 covariance = Mat9::Zero();           ///< of the increment, from white noise: Forster (63)
  Mat93 by_gyroscope_bias = Mat93::Zero();  ///< derivatives: Forster, appendix B
  Mat93 by_accelerometer_bias = Mat93::Zero();

  /// Returns the increment for other biases, to first order: Forster (44).
  Increment corrected(const geometry::ImuBias& other) const;
};

/// Integrates the samples from `from_s` to `to_s`; readings between samples are linear. nullopt if the samples do not
/// reach over the whole interval, or if `to_s` is not after `from_s`. The samples' times must increase.
std::optional<Preintegration> preintegrate(std::span<const geometry::ImuSample> samples, double from_s, double to_s,
                                           const geometry::ImuBias& bias, const ImuNoise& noise);

}  // namespace tileflight::inertial
