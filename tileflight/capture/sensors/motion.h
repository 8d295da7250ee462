#pragma once

#include <functional>

#include "tileflight/capture/flight_path/path.h"
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

/// The camera's motion along a path.
MotionFunction motion_along(const flight_path::Path& path);

/// The motion of a sensor fixed to the body. With the lever arm r = T_body_sensor.translation:
/// v_sensor = v + R (w x r), a_sensor = a + R (dw/dt x r + w x (w x r)).
Motion rigidly_attached_motion(const Motion& body, const geometry::SE3& T_body_sensor);

}  // namespace tileflight::sensors
