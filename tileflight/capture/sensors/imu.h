#pragma once

#include <cstdint>
#include <functional>
#include <limits>
#include <string>
#include <vector>

#include "tileflight/capture/flight_path/path.h"
#include "tileflight/core/geometry/imu_sample.h"
#include "tileflight/core/geometry/transform.h"

namespace tileflight::sensors {

/// Pose, velocity and acceleration of a rigid body at a time.
struct Motion {
  geometry::SE3 T_local_body;
  geometry::Vec3 velocity = geometry::Vec3::Zero();              ///< of the body's origin, local frame, m/s
  geometry::Vec3 acceleration = geometry::Vec3::Zero();          ///< of its origin, local frame, m/s^2, without gravity
  geometry::Vec3 angular_velocity = geometry::Vec3::Zero();      ///< in body axes, rad/s
  geometry::Vec3 angular_acceleration = geometry::Vec3::Zero();  ///< its derivative, in body axes, rad/s^2
};

/// A body's motion as a function of time in seconds. Safe to call from several threads at once.
using MotionFunction = std::function<Motion(double time_s)>;

/// Returns the camera's motion along a path.
MotionFunction motion_along(const flight_path::Path& path);

/// Computes the motion of a sensor fixed to the body. With the lever arm r = T_body_sensor.translation:
/// v_sensor = v + R (w x r), a_sensor = a + R (dw/dt x r + w x (w x r)).
Motion rigidly_attached_motion(const Motion& body, const geometry::SE3& T_body_sensor);

/// An inertial measurement unit and its errors. The noise model and its names are Kalibr's (its wiki, "IMU Noise
/// Model"): white noise and a random-walk bias on each axis. Default noise is that of the EuRoC sequences' ADIS16448
/// (mav0/imu0/sensor.yaml; Burri et al., IJRR 2016), default ranges those of Analog Devices' data sheet (1000 deg/s, 18
/// g).
struct ImuOptions {
  std::uint64_t seed = 1;
  double rate_hz = 200.0;
  geometry::SE3 T_camera_imu;  ///< mounting pose on the camera: Kalibr's T_cam_imu

  double accelerometer_noise_density = 2.0e-3;  ///< m/s^2/sqrt(Hz)
  double accelerometer_random_walk = 3.0e-3;    ///< of the bias, m/s^3/sqrt(Hz)
  double gyroscope_noise_density = 1.6968e-4;   ///< rad/s/sqrt(Hz)
  double gyroscope_random_walk = 1.9393e-5;     ///< of the bias, rad/s^2/sqrt(Hz)

  geometry::Vec3 accelerometer_bias = geometry::Vec3::Zero();  ///< at the first sample, m/s^2
  geometry::Vec3 gyroscope_bias = geometry::Vec3::Zero();      ///< at the first sample, rad/s

  /// Measured = M * true: scale factors on the diagonal, misalignment off it.
  geometry::Mat3 accelerometer_scale_misalignment = geometry::Mat3::Identity();
  geometry::Mat3 gyroscope_scale_misalignment = geometry::Mat3::Identity();

  double accelerometer_range_m_s2 = 18.0 * 9.80665;  ///< values saturate beyond it, each axis separately
  double gyroscope_range_rad_s = 17.453292519943295;

  double gravity_m_s2 = 9.80665;  ///< straight down in the local frame; the earth's rotation is neglected
};

/// Returns the IMU model of a name: "adis16448" (the defaults), "bmi160" (a smartphone IMU; noise as the TUM VI
/// sequences state it for estimators, Schubert et al., IROS 2018; ranges of Bosch's data sheet, 2000 deg/s and 16 g),
/// "perfect" (no errors and no limits). Throws InputError that lists them for other names.
ImuOptions imu_preset(const std::string& name);

/// Throws InputError for options out of range.
void check(const ImuOptions& options);

/// The samples of an IMU and their true biases, for checking an estimate of them.
struct ImuRecording {
  std::vector<geometry::ImuSample> samples;
  std::vector<geometry::ImuBias> biases;  ///< one per sample
};

/// Simulates samples at start, start + 1 / rate, ... up to end, of an IMU mounted on a camera. Noise has the standard
/// deviation density * sqrt(rate), bias steps random walk / sqrt(rate). Throws InputError for options out of range or
/// an end before the start.
ImuRecording simulate_imu(const MotionFunction& camera, double start_s, double end_s, const ImuOptions& options = {});

}  // namespace tileflight::sensors
