#pragma once

// For the tests of odometry with an inertial unit: rendered flights over hilly ground with the unit's readings.

#include <functional>
#include <vector>

#include "tileflight/slam/inertial/test_smooth_motion.h"
#include "tileflight/slam/odometry/synthetic_flight.h"

namespace tileflight::odometry::test_support {

using geometry::SE3;
using geometry::Vec3;
using inertial::test_support::SmoothMotion;

constexpr double kInertialFps = 30.0;
inline const SE3 kT_imu_camera(Eigen::Quaterniond(0.5, -0.5, 0.5, -0.5), Vec3(0.1, 0.03, -0.05));

/// Over the hills, with changes of speed and direction; the camera looks ahead and down.
inline SE3 lively_camera(double t) {
  return keyframes::test_support::look_along(
      Vec3(2.5 * std::sin(1.1 * t), 3.0 * t + 0.8 * std::sin(1.7 * t), 12.0 + 0.6 * std::sin(1.4 * t)),
      Vec3(0.25 * std::sin(0.8 * t), 1.0, -1.1 + 0.1 * std::sin(1.3 * t)));
}
/// Straight ahead at constant velocity.
inline SE3 steady_camera(double t) {
  return keyframes::test_support::look_along(Vec3(1.0 * t, 4.0 * t, 12.0), Vec3(0.1, 1.0, -1.1));
}

struct InertialFlight {
  Sequence sequence;
  inertial::InertialInput readings;
};

inline InertialFlight fly(const std::function<SE3(double)>& camera, int frames) {
  std::vector<SE3> truth;
  for (int i = 0; i < frames; ++i) truth.push_back(camera(i / kInertialFps));
  const SE3 T_camera_imu = kT_imu_camera.inverse();
  const SmoothMotion imu{[=](double t) { return Vec3((camera(t) * T_camera_imu).translation); },
                         [=](double t) { return (camera(t) * T_camera_imu).rotation; }};
  InertialFlight flight{render_sequence(imaging::make_fisheye(320, 240, 120.0), hilly_ground(), std::move(truth)), {}};
  flight.readings.samples =
      imu.readings(-0.1, frames / kInertialFps + 0.1, 200.0, {{0.01, -0.02, 0.01}, {0.1, -0.05, 0.08}});
  inertial::test_support::add_noise({}, 200.0, 3, flight.readings.samples);
  flight.readings.model.T_imu_camera = kT_imu_camera;
  return flight;
}

}  // namespace tileflight::odometry::test_support
