#pragma once

// Readings of an inertial unit as an estimator takes them.

#include <vector>

#include "tileflight/core/geometry/imu_sample.h"

namespace tileflight::inertial {

/// Noise of the unit under Kalibr's names: white noise, and the random walk of the biases. Defaults: EuRoC's ADIS16448.
struct ImuNoise {
  double accelerometer_noise_density = 2.0e-3;  ///< m/s^2/sqrt(Hz)
  double accelerometer_random_walk = 3.0e-3;    ///< m/s^3/sqrt(Hz)
  double gyroscope_noise_density = 1.6968e-4;   ///< rad/s/sqrt(Hz)
  double gyroscope_random_walk = 1.9393e-5;     ///< rad/s^2/sqrt(Hz)
};

/// Noise, mounting and gravity of an inertial unit, which are known besides its readings.
struct ImuModel {
  ImuNoise noise;
  geometry::SE3 T_imu_camera;  ///< inverse of Kalibr's T_cam_imu
  double gravity_m_s2 = 9.80665;
  double gyroscope_bias_sigma = 0.1;      ///< of the first bias, rad/s
  double accelerometer_bias_sigma = 0.5;  ///< m/s^2
  double mounting_sigma_rad = 0.005;      ///< of the given rotation, about each axis
};

/// Raises the densities of white noise to what the readings scatter by from one to the next, vibration included. Motion
/// adds next to nothing to it at the rates of inertial units.
ImuNoise at_least_scatter(ImuNoise noise, const std::vector<geometry::ImuSample>& samples);

/// Returns the samples of the same motion played backwards: times and angular rates change their signs, specific forces
/// do not (an acceleration is a second derivative). The gyroscope's biases change their signs, too.
std::vector<geometry::ImuSample> reversed(const std::vector<geometry::ImuSample>& samples);

}  // namespace tileflight::inertial
