#pragma once

#include <cmath>
#include <numbers>

#include "tileflight/core/geometry/transform.h"
#include "tileflight/live/simulator/airsim_types.h"

namespace tileflight::simulator {

// Internally, poses are rigid transforms in double precision between these frames:
//   local   of the scene: east, north, up, metres
//   ned     global NED: north, east, down from NED's origin
//   body    of a vehicle: x forward, y right, z down (in the room vehicle: x forward, y left, z up)
//   camera  the client's: x forward, y right, z down; of images (imaging): x right, y down, z forward

/// Swaps north and east and negates the vertical axis; its own inverse.
inline geometry::Vec3 ned_from_enu(const geometry::Vec3& v) { return {v.y(), v.x(), -v.z()}; }
inline geometry::Vec3 enu_from_ned(const geometry::Vec3& v) { return ned_from_enu(v); }

/// Negates the y and z axes; its own inverse.
inline geometry::Vec3 frd_from_flu(const geometry::Vec3& v) { return {v.x(), -v.y(), -v.z()}; }

/// Pose of global NED in the local frame, with its origin at this point.
inline geometry::SE3 T_local_ned_at(const geometry::Vec3& origin_local) {
  geometry::Mat3 axes;
  axes << 0, 1, 0, 1, 0, 0, 0, 0, -1;
  return {axes, origin_local};
}

/// Rotation from a body frame with y right and z down to one with y left and z up.
inline geometry::SE3 T_flu_frd() { return {Eigen::Quaterniond(0, 1, 0, 0), geometry::Vec3::Zero()}; }

/// Rotation from image axes to the client's camera axes.
inline geometry::SE3 T_frd_optical() {
  geometry::Mat3 axes;
  axes << 0, 0, 1, 1, 0, 0, 0, 1, 0;
  return {axes, geometry::Vec3::Zero()};
}

inline double radians(double degrees) { return degrees * std::numbers::pi / 180.0; }
inline double degrees(double radians) { return radians * 180.0 / std::numbers::pi; }

/// Rotation by yaw about z, then pitch about the new y, then roll about the new x, radians.
inline Eigen::Quaterniond rotation_from_rpy(double roll, double pitch, double yaw) {
  using geometry::Vec3;
  return Eigen::AngleAxisd(yaw, Vec3::UnitZ()) * Eigen::AngleAxisd(pitch, Vec3::UnitY()) *
         Eigen::AngleAxisd(roll, Vec3::UnitX());
}

/// Heading of the body's x axis, clockwise from north.
inline double heading_rad(const Eigen::Quaterniond& R_ned_body) {
  const geometry::Vec3 forward = R_ned_body * geometry::Vec3::UnitX();
  return std::atan2(forward.y(), forward.x());
}

/// Unit vector in a sensor's axes (forward, right, down); azimuth clockwise seen from above, elevation positive
/// upwards.
inline geometry::Vec3 sensor_direction(double azimuth_rad, double elevation_rad) {
  const double level = std::cos(elevation_rad);
  return {level * std::cos(azimuth_rad), level * std::sin(azimuth_rad), -std::sin(elevation_rad)};
}

/// Conversions between internal types (double) and AirSim's structures (float).
inline Vector3r to_airsim(const geometry::Vec3& v) {
  return {static_cast<float>(v.x()), static_cast<float>(v.y()), static_cast<float>(v.z())};
}
inline Quaternionr to_airsim(const Eigen::Quaterniond& q) {
  return {static_cast<float>(q.w()), static_cast<float>(q.x()), static_cast<float>(q.y()), static_cast<float>(q.z())};
}
inline Pose to_airsim(const geometry::SE3& T) { return {to_airsim(T.translation), to_airsim(T.rotation)}; }

inline geometry::Vec3 to_vec3(const Vector3r& v) { return {v.x_val, v.y_val, v.z_val}; }
inline Eigen::Quaterniond to_quaternion(const Quaternionr& q) { return {q.w_val, q.x_val, q.y_val, q.z_val}; }

}  // namespace tileflight::simulator
