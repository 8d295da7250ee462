#include "tileflight/capture/flight_path/orientation_curve.h"

#include <cmath>

#include "tileflight/capture/flight_path/path.h"
#include "tileflight/core/geometry/transform.h"

namespace tileflight::flight_path {
namespace {

using geometry::Mat3;
using geometry::Vec3;

using geometry::kRadiansPerDegree;

Mat3 rolled(const Vec3& forward, const Vec3& right, double roll_deg) {
  const Vec3 down = forward.cross(right);
  const double c = std::cos(roll_deg * kRadiansPerDegree), s = std::sin(roll_deg * kRadiansPerDegree);
  Mat3 R_local_camera;
  R_local_camera << c * right + s * down, c * down - s * right, forward;
  return R_local_camera;
}

/// The vector part of conjugate(a) b.
Vec3 turned_by(const Eigen::Vector4d& a, const Eigen::Vector4d& b) {
  return (Eigen::Quaterniond(a.data()).conjugate() * Eigen::Quaterniond(b.data())).vec();
}

/// A function of u: its value and its derivatives.
struct ValueWithDerivatives {
  double value = 0.0, first = 0.0, second = 0.0;
};

/// Derivatives of a direction's heading (clockwise from north); the value itself is not needed.
ValueWithDerivatives heading_of(const MovingPoint& d) {
  const Vec3 &p = d.position, &v = d.first_derivative, &a = d.second_derivative;
  const double across = p.head<2>().squaredNorm(), across_rate = 2.0 * p.head<2>().dot(v.head<2>());
  const double area = v.x() * p.y() - p.x() * v.y(), area_rate = a.x() * p.y() - p.x() * a.y();
  return {0.0, area / across, area_rate / across - area * across_rate / (across * across)};
}

/// Derivatives of a direction's elevation above the horizon; the value itself is not needed.
ValueWithDerivatives elevation_of(const MovingPoint& d) {
  const Vec3 &p = d.position, &v = d.first_derivative, &a = d.second_derivative;
  const ValueWithDerivatives flat = [&] {
    const double length = p.head<2>().norm(), rate = p.head<2>().dot(v.head<2>()) / length;
    return ValueWithDerivatives{length, rate,
                                (v.head<2>().squaredNorm() + p.head<2>().dot(a.head<2>()) - rate * rate) / length};
  }();
  const double squared = p.squaredNorm(), squared_rate = 2.0 * p.dot(v);
  const double area = v.z() * flat.value - p.z() * flat.first, area_rate = a.z() * flat.value - p.z() * flat.second;
  return {0.0, area / squared, area_rate / squared - area * squared_rate / (squared * squared)};
}

}  // namespace

Eigen::Quaterniond orientation_looking_along(const Vec3& to_target, double roll_deg) {
  const Vec3 forward = to_target.normalized();
  return Eigen::Quaterniond(rolled(forward, forward.cross(Vec3::UnitZ()).normalized(), roll_deg));
}

Eigen::Quaterniond camera_orientation(double yaw_deg, double pitch_deg, double roll_deg) {
  const double yaw = yaw_deg * kRadiansPerDegree, pitch = pitch_deg * kRadiansPerDegree;
  const Vec3 forward(std::sin(yaw) * std::cos(pitch), std::cos(yaw) * std::cos(pitch), std::sin(pitch));
  const Vec3 right(std::cos(yaw), -std::sin(yaw), 0.0);
  return Eigen::Quaterniond(rolled(forward, right, roll_deg));
}

Eigen::Quaterniond BlendedOrientation::at(double u) const {
  const Eigen::Vector4d q = quaternion.value(u);
  return Eigen::Quaterniond(q.data()).normalized();
}

/// For q of any length, rate = 2 vec(q* q') / |q|^2 (the scalar part of q* q' only changes the length); its derivative
/// has no term in q'* q', whose vector part is zero.
AngularMotion BlendedOrientation::angular_motion(double u) const {
  const Eigen::Vector4d q = quaternion.value(u), dq = quaternion.first_derivative(u);
  const double squared = q.squaredNorm();
  const Vec3 rate = 2.0 / squared * turned_by(q, dq);
  return {rate, 2.0 / squared * (turned_by(q, quaternion.second_derivative(u)) - q.dot(dq) * rate)};
}

Eigen::Quaterniond TargetOrientation::at(double u, const Vec3& position) const {
  const Eigen::Vector4d value = target_and_roll.value(u);
  return orientation_looking_along(value.head<3>() - position, value[3]);
}

/// The camera rotates by its heading about the vertical, by its elevation about the level axis to its right, and by its
/// roll about its own axis; each axis is rotated by the preceding angles.
AngularMotion TargetOrientation::angular_motion(double u, const MovingPoint& camera) const {
  const Eigen::Vector4d target = target_and_roll.value(u), first = target_and_roll.first_derivative(u),
                        second = target_and_roll.second_derivative(u);
  const MovingPoint d{target.head<3>() - camera.position, first.head<3>() - camera.first_derivative,
                      second.head<3>() - camera.second_derivative};
  const ValueWithDerivatives heading = heading_of(d), elevation = elevation_of(d);
  const Vec3 forward = d.position.normalized(), right = forward.cross(Vec3::UnitZ()).normalized();
  const Vec3 by_heading = -heading.first * Vec3::UnitZ(), by_elevation = elevation.first * right;
  const Vec3 by_roll = first[3] * kRadiansPerDegree * forward;
  const Vec3 rate = by_heading + by_elevation + by_roll;
  const Vec3 acceleration = -heading.second * Vec3::UnitZ() + elevation.second * right +
                            second[3] * kRadiansPerDegree * forward + by_heading.cross(by_elevation) +
                            (by_heading + by_elevation).cross(by_roll);
  const Eigen::Quaterniond R_camera_local = at(u, camera.position).conjugate();
  return {R_camera_local * rate, R_camera_local * acceleration};
}

}  // namespace tileflight::flight_path
