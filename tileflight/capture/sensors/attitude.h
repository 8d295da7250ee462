#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include "tileflight/capture/flight_path/path.h"
#include "tileflight/core/geometry/transform.h"

namespace tileflight::sensors {

/// Errors of the camera's attitude as measured by a gimbal or a vehicle's filter: white noise, and slowly varying
/// biases of tilt and heading.
struct AttitudeOptions {
  std::uint64_t seed = 1;
  double rate_hz = 10.0;
  double noise_deg = 0.1;            ///< white noise about each axis
  double tilt_bias_sigma_deg = 0.5;  ///< about east and north: calibration accuracy of gimbals of consumer drones
  double yaw_bias_sigma_deg = 3.0;   ///< about up: a compass in a drone
  double bias_time_s = 300.0;        ///< correlation time of the biases
};

/// Throws InputError (option, cause) if a value is out of range.
void check(const AttitudeOptions& options);

/// A measured attitude of the camera.
struct AttitudeSample {
  double time_s = 0.0;
  Eigen::Quaterniond R_local_camera = Eigen::Quaterniond::Identity();
};

/// Simulates the camera's attitude at each time, with errors in the local frame. Throws InputError as check() does.
std::vector<AttitudeSample> simulate_attitude(const std::function<geometry::SE3(double time_s)>& pose_at,
                                              const flight_path::SampleTimes& times, const AttitudeOptions& options);

/// Return the standard deviations that a log would state, of tilt and of heading, degrees.
double tilt_sigma_deg(const AttitudeOptions& options);
double yaw_sigma_deg(const AttitudeOptions& options);

}  // namespace tileflight::sensors
