#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include "tileflight/geometry/transform.h"
#include "tileflight/sensors/sample_times.h"

namespace tileflight::sensors {

/// Errors of the camera's attitude as a gimbal or a vehicle's filter gives it: white noise, and a bias of tilt and
/// heading that wanders slowly.
struct AttitudeOptions {
  std::uint64_t seed = 1;
  double rate_hz = 10.0;
  double noise_deg = 0.1;            ///< white, each axis
  double tilt_bias_sigma_deg = 0.5;  ///< about east and north: what gimbals of consumer drones are calibrated to
  double yaw_bias_sigma_deg = 3.0;   ///< about up: a compass in a drone
  double bias_time_s = 300.0;        ///< over which a bias is forgotten
};

/// Throws InputError (option, cause) where a value is out of its range.
void check(const AttitudeOptions& options);

struct AttitudeSample {
  double time_s = 0.0;
  Eigen::Quaterniond R_local_camera = Eigen::Quaterniond::Identity();
};

/// The camera's attitude at each time, turned in the local frame by the errors. Throws InputError as check() does.
std::vector<AttitudeSample> simulate_attitude(const std::function<geometry::SE3(double time_s)>& pose_at,
                                              const SampleTimes& times, const AttitudeOptions& options);

/// What a log would state of its errors: tilt and heading, degrees.
double tilt_sigma_deg(const AttitudeOptions& options);
double yaw_sigma_deg(const AttitudeOptions& options);

}  // namespace tileflight::sensors
