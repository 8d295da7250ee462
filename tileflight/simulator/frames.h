#pragma once

#include <cmath>
#include <numbers>

#include "tileflight/geometry/transform.h"
#include "tileflight/simulator/airsim_types.h"

namespace tileflight::simulator {

// Inside, poses are rigid motions in double precision between these frames:
//   local   the scene's: east, north, up, metres
//   ned     global NED: north, east, down from where NED has its origin
//   body    of a vehicle: x forward, y right, z down (of flight's rigid bodies: x forward, y left, z up)
//   camera  as clients have it: x forward, y right, z down; of pictures (imaging): x right, y down, z forward

/// Exchanges north with east and down with up; its own inverse.
inline geometry::Vec3 ned_of_enu(const geometry::Vec3& v) { return {v.y(), v.x(), -v.z()}; }
inline geometry::Vec3 enu_of_ned(const geometry::Vec3& v) { return ned_of_enu(v); }

/// Exchanges left with right and up with down; its own inverse.
inline geometry::Vec3 frd_of_flu(const geometry::Vec3& v) { return {v.x(), -v.y(), -v.z()}; }

/// Where NED has its origin in the local frame, as a transform.
inline geometry::SE3 T_local_ned_at(const geometry::Vec3& origin_local) {
  geometry::Mat3 axes;
  axes << 0, 1, 0, 1, 0, 0, 0, 0, -1;
  return {axes, origin_local};
}

/// From a body with y left and z up to one with y right and z down.
inline geometry::SE3 T_flu_frd() { return {Eigen::Quaterniond(0, 1, 0, 0), geometry::Vec3::Zero()}; }

/// From a picture's axes to those that clients have for a camera.
inline geometry::SE3 T_frd_optical() {
  geometry::Mat3 axes;
  axes << 0, 0, 1, 1, 0, 0, 0, 1, 0;
  return {axes, geometry::Vec3::Zero()};
}

inline double radians(double degrees) { return degrees * std::numbers::pi / 180.0; }
inline double degrees(double radians) { return radians * 180.0 / std::numbers::pi; }

/// Turns about z (yaw), then the new y (pitch), then the new x (roll), radians.
inline Eigen::Quaterniond rotation_of_angles(double roll, double pitch, double yaw) {
  using geometry::Vec3;
  return Eigen::AngleAxisd(yaw, Vec3::UnitZ()) * Eigen::AngleAxisd(pitch, Vec3::UnitY()) *
         Eigen::AngleAxisd(roll, Vec3::UnitX());
}

/// Of the body's x axis seen from above, clockwise from north.
inline double heading_rad(const Eigen::Quaterniond& R_ned_body) {
  const geometry::Vec3 forward = R_ned_body * geometry::Vec3::UnitX();
  return std::atan2(forward.y(), forward.x());
}

inline Vector3r wire(const geometry::Vec3& v) {
  return {static_cast<float>(v.x()), static_cast<float>(v.y()), static_cast<float>(v.z())};
}
inline Quaternionr wire(const Eigen::Quaterniond& q) {
  return {static_cast<float>(q.w()), static_cast<float>(q.x()), static_cast<float>(q.y()), static_cast<float>(q.z())};
}
inline Pose wire(const geometry::SE3& T) { return {wire(T.translation), wire(T.rotation)}; }

inline geometry::Vec3 vec3(const Vector3r& v) { return {v.x_val, v.y_val, v.z_val}; }
inline Eigen::Quaterniond quaternion(const Quaternionr& q) { return {q.w_val, q.x_val, q.y_val, q.z_val}; }

}  // namespace tileflight::simulator
