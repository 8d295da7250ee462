#pragma once

#include <memory>
#include <vector>

#include "tileflight/flight/b_spline.h"
#include "tileflight/flight/flight_plan.h"
#include "tileflight/flight/rotation_spline.h"

namespace tileflight::flight {

/// A path that can be asked at any time between its start and its end (other times are clamped). Position and
/// orientation are twice continuously differentiable in time. Cheap to copy; may be asked from several threads.
class Path {
 public:
  double start_s() const;
  double end_s() const;

  geometry::SE3 pose(double time_s) const;               ///< T_local_camera
  geometry::Vec3 velocity(double time_s) const;          ///< of the camera, local frame, m/s
  geometry::Vec3 acceleration(double time_s) const;      ///< of the camera, local frame, m/s^2, without gravity
  geometry::Vec3 angular_velocity(double time_s) const;  ///< of the camera in the local frame, in camera axes, rad/s
  geometry::Vec3 angular_acceleration(double time_s) const;  ///< its derivative, in camera axes, rad/s^2

  struct Motion;  ///< path.cpp
  explicit Path(std::shared_ptr<const Motion> motion);

 private:
  std::shared_ptr<const Motion> motion_;
};

/// Through all waypoints in order, from rest at the first to rest at the last, starting at time 0. Positions are a
/// cubic spline (knots spaced by the root of the distance: Lee, Computer-Aided Design 21(6), 1989), flown as fast as
/// the limits allow (SpeedPlan); yaw_rate_deg_s bounds the camera's whole turning rate. Where every waypoint has a
/// look_at, the camera looks exactly at a target that moves smoothly from one to the next; else orientations are
/// blended and met exactly at the waypoints. Throws InputError: fewer than two waypoints, two in a row at one place,
/// non-finite numbers, limits that are not positive, looking straight up or down at a look_at.
Path path_through_waypoints(const std::vector<Waypoint>& waypoints, const SpeedLimits& limits);

/// Through all poses at their times (at least two). Positions are a cubic spline in time; so are the unit quaternions,
/// brought back to unit length. Throws InputError for fewer than two poses.
Path path_through_poses(const geometry::Trajectory& trajectory);

/// Along a spline of positions and one of rotations that have their start and end in common; their parameter is time.
/// smooth_path() fits them to poses.
Path path_along(BSpline<3> position, RotationSpline rotation);

/// Orientation of a camera (x right, y down, z forward) by compass heading clockwise from north, elevation of its axis
/// above the horizon, and roll about the axis (positive: right side down), degrees.
Eigen::Quaterniond camera_orientation(double yaw_deg, double pitch_deg, double roll_deg);

}  // namespace tileflight::flight
