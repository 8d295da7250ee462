#pragma once

#include <cstdint>
#include <limits>
#include <string>
#include <vector>

#include "tileflight/geometry/transform.h"
#include "tileflight/sensors/motion.h"

namespace tileflight::sensors {

/// An inertial measurement unit and its errors. The noise is Kalibr's model under Kalibr's names (its wiki, "IMU Noise
/// Model"): white noise and a bias that walks randomly, each axis on its own. The defaults are those that the EuRoC
/// sequences give for their ADIS16448 (mav0/imu0/sensor.yaml; Burri et al., IJRR 2016), its ranges those of Analog
/// Devices' data sheet (1000 deg/s, 18 g).
struct ImuOptions {
  std::uint64_t seed = 1;
  double rate_hz = 200.0;
  geometry::SE3 T_camera_imu;  ///< where it sits on the camera: Kalibr's T_cam_imu

  double accelerometer_noise_density = 2.0e-3;  ///< m/s^2/sqrt(Hz)
  double accelerometer_random_walk = 3.0e-3;    ///< of the bias, m/s^3/sqrt(Hz)
  double gyroscope_noise_density = 1.6968e-4;   ///< rad/s/sqrt(Hz)
  double gyroscope_random_walk = 1.9393e-5;     ///< of the bias, rad/s^2/sqrt(Hz)

  geometry::Vec3 accelerometer_bias = geometry::Vec3::Zero();  ///< at the first sample, m/s^2
  geometry::Vec3 gyroscope_bias = geometry::Vec3::Zero();      ///< at the first sample, rad/s

  /// What is measured is M times what is: scale factors on the diagonal, misalignment beside it.
  geometry::Mat3 accelerometer_scale_misalignment = geometry::Mat3::Identity();
  geometry::Mat3 gyroscope_scale_misalignment = geometry::Mat3::Identity();

  double accelerometer_range_m_s2 = 18.0 * 9.80665;  ///< values are cut off beyond, each axis on its own
  double gyroscope_range_rad_s = 17.453292519943295;

  double gravity_m_s2 = 9.80665;  ///< straight down in the local frame; the earth's turning is left out
};

/// Parts that a flight can name: "adis16448" (the defaults), "bmi160" (a phone's part; noise as the TUM VI sequences
/// give it for estimators, Schubert et al., IROS 2018; ranges of Bosch's data sheet, 2000 deg/s and 16 g), "perfect"
/// (no errors and no limits). Throws InputError that lists them.
ImuOptions imu_preset(const std::string& name);

/// Throws InputError for options out of range.
void check(const ImuOptions& options);

/// One sample: what the unit reads at an instant, in its own axes.
struct ImuSample {
  double time_s = 0.0;
  geometry::Vec3 angular_rate_rad_s;
  geometry::Vec3 specific_force_m_s2;  ///< at rest: gravity upwards
};

/// The biases behind a sample, for those who want to check an estimate of them.
struct ImuBias {
  geometry::Vec3 gyroscope_rad_s;
  geometry::Vec3 accelerometer_m_s2;
};

struct ImuRecording {
  std::vector<ImuSample> samples;
  std::vector<ImuBias> biases;  ///< one a sample
};

/// Samples at start, start + 1 / rate, ... up to end, of an IMU that is carried by a camera. Noise of standard
/// deviation density * sqrt(rate), bias steps of random walk / sqrt(rate). Throws InputError for options out of range
/// or an end before the start.
ImuRecording simulate_imu(const MotionFunction& camera, double start_s, double end_s, const ImuOptions& options = {});

}  // namespace tileflight::sensors
