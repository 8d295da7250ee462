#include "tileflight/capture/sensors/motion.h"

namespace tileflight::sensors {

using geometry::Vec3;

MotionFunction motion_along(const flight_path::Path& path) {
  return [path](double time_s) {
    return Motion{path.pose(time_s), path.velocity(time_s), path.acceleration(time_s), path.angular_velocity(time_s),
                  path.angular_acceleration(time_s)};
  };
}

Motion rigidly_attached_motion(const Motion& body, const geometry::SE3& T_body_sensor) {
  const Eigen::Quaterniond& R_local_body = body.T_local_body.rotation;
  const Eigen::Quaterniond R_sensor_body = T_body_sensor.rotation.conjugate();
  const Vec3 &arm = T_body_sensor.translation, &w = body.angular_velocity;
  return {body.T_local_body * T_body_sensor, body.velocity + R_local_body * w.cross(arm),
          body.acceleration + R_local_body * (body.angular_acceleration.cross(arm) + w.cross(w.cross(arm))),
          R_sensor_body * w, R_sensor_body * body.angular_acceleration};
}

}  // namespace tileflight::sensors
