#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "tileflight/capture/flight_path/b_spline.h"
#include "tileflight/capture/flight_path/rotation_spline.h"
#include "tileflight/core/geometry/trajectory.h"
#include "tileflight/core/geometry/transform.h"

namespace tileflight::flight_path {

/// A waypoint of a mission, in the local frame.
struct Waypoint {
  geometry::Vec3 position;                ///< camera position, metres, east north up
  std::optional<geometry::Vec3> look_at;  ///< point to look at; without it yaw and pitch apply
  double yaw_deg = 0.0;                   ///< heading clockwise from north
  double pitch_deg = 0.0;                 ///< of the optical axis, positive up; -90 is straight down
  double roll_deg = 0.0;
  std::optional<double> speed_m_s{};  ///< limit from here to the next waypoint; nullopt: that of SpeedLimits
  std::optional<double> hold_s{};     ///< comes to rest here for so long; nullopt: flies through
};

/// Limits of a flight through waypoints.
struct SpeedLimits {
  double speed_m_s = 8.0;
  double acceleration_m_s2 = 4.0;
  double yaw_rate_deg_s = 60.0;
};

/// Sampling times of a sensor: start, start + 1 / rate, ... up to end.
struct SampleTimes {
  double start_s = 0.0, end_s = 0.0, rate_hz = 1.0;

  std::uint64_t count() const { return static_cast<std::uint64_t>((end_s - start_s) * rate_hz + 1e-6) + 1; }
  double at(std::uint64_t i) const { return start_s + static_cast<double>(i) / rate_hz; }
};

/// Throws InputError (sensor, cause) unless the rate is above 0 and at most 100 kHz and the end is not before the
/// start.
SampleTimes make_sample_times(const char* sensor, double start_s, double end_s, double rate_hz);

/// A camera path that can be evaluated at any time from its start to its end; other times are clamped. Position and
/// orientation are twice continuously differentiable in time. Cheap to copy and safe to evaluate from several threads.
class Path {
 public:
  double start_s() const;
  double end_s() const;

  geometry::SE3 pose(double time_s) const;               ///< T_local_camera
  geometry::Vec3 velocity(double time_s) const;          ///< of the camera, local frame, m/s
  geometry::Vec3 acceleration(double time_s) const;      ///< of the camera, local frame, m/s^2, without gravity
  geometry::Vec3 angular_velocity(double time_s) const;  ///< of the camera in the local frame, in camera axes, rad/s
  geometry::Vec3 angular_acceleration(double time_s) const;  ///< its derivative, in camera axes, rad/s^2

  struct Motion;  ///< defined in path.cpp
  explicit Path(std::shared_ptr<const Motion> motion);

 private:
  std::shared_ptr<const Motion> motion_;
};

/// Returns a path through all waypoints in order, at rest at the first and the last, starting at time 0. Positions are
/// a cubic spline (knot spacing: square root of the distance; Lee, Computer-Aided Design 21(6), 1989), flown as fast as
/// the limits allow (SpeedPlan), with rests where waypoints have a hold_s; yaw_rate_deg_s limits the camera's total
/// angular rate. If every waypoint has a look_at, the camera looks exactly at a target that moves smoothly between
/// them; otherwise orientations are blended and are exact at the waypoints. Throws InputError: fewer than two
/// waypoints, two consecutive ones at one position, non-finite numbers, limits and speeds that are not positive, a
/// hold_s below 0, a look_at straight above or below the camera.
Path path_through_waypoints(const std::vector<Waypoint>& waypoints, const SpeedLimits& limits);

/// Returns a path through all poses at their times (at least two). Positions are a cubic spline in time, and so are the
/// unit quaternions, which are then normalized. Throws InputError for fewer than two poses.
Path path_through_poses(const geometry::Trajectory& trajectory);

/// Returns a path along a position spline and a rotation spline with the same start and end; their parameter is time.
/// smooth_path() fits such splines to poses.
Path path_along_splines(BSpline<3> position, RotationSpline rotation);

/// Computes the orientation of a camera (x right, y down, z forward) from its compass heading (clockwise from north),
/// the elevation of its optical axis above the horizon, and its roll about that axis (positive: right side down), in
/// degrees.
Eigen::Quaterniond camera_orientation(double yaw_deg, double pitch_deg, double roll_deg);

}  // namespace tileflight::flight_path
