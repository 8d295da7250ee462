#include "tileflight/capture/vehicle/rigid_body.h"

#include <cmath>
#include <numbers>

namespace tileflight::vehicle {
namespace {

using geometry::Mat3;
using geometry::Vec3;
using std::numbers::pi;

/// Derivatives of position, velocity, rotation vector and angular velocity.
struct StateDelta {
  Vec3 position = Vec3::Zero(), velocity = Vec3::Zero(), rotation = Vec3::Zero(), rate = Vec3::Zero();

  StateDelta operator*(double s) const { return {s * position, s * velocity, s * rotation, s * rate}; }
  StateDelta operator+(const StateDelta& o) const {
    return {position + o.position, velocity + o.velocity, rotation + o.rotation, rate + o.rate};
  }
};

RigidBodyState apply_delta(const RigidBodyState& s, const StateDelta& c) {
  return {s.position_m + c.position, s.velocity_m_s + c.velocity,
          (s.R_local_body * geometry::so3_exp(c.rotation)).normalized(), s.angular_velocity_rad_s + c.rate};
}

/// Derivative of the rotation vector theta of R exp(theta) at the body rate w: theta' = w + theta x w / 2 + theta x
/// (theta x w) / 12 + O(theta^4), the inverse of the exponential's differential (Munthe-Kaas 1998, (9), for body
/// rates).
Vec3 rotation_vector_rate(const Vec3& theta, const Vec3& w) {
  const Vec3 cross = theta.cross(w);
  return w + cross / 2.0 + theta.cross(cross) / 12.0;
}

}  // namespace

RigidBodyState integrate(const RigidBody& body, const RigidBodyState& state, double step_s,
                         const WrenchFunction& wrench) {
  const Mat3& J = body.inertia_kg_m2;
  const Mat3 J_inverse = J.inverse();
  const auto derivative = [&](const StateDelta& since, double time_s) {
    const RigidBodyState at = apply_delta(state, since);
    const Wrench w = wrench(at, time_s);
    const Vec3& rate = at.angular_velocity_rad_s;
    return StateDelta{at.velocity_m_s, w.force_n / body.mass_kg, rotation_vector_rate(since.rotation, rate),
                      J_inverse * (w.torque_nm - rate.cross(J * rate))};  // Euler's equations
  };
  const double h = step_s;
  const StateDelta k1 = derivative({}, 0.0);
  const StateDelta k2 = derivative(k1 * (h / 2), h / 2);
  const StateDelta k3 = derivative(k2 * (h / 2), h / 2);
  const StateDelta k4 = derivative(k3 * h, h);
  return apply_delta(state, (k1 + (k2 + k3) * 2.0 + k4) * (h / 6.0));
}

double yaw_rad(const Eigen::Quaterniond& R_local_body) {
  const Vec3 forward = R_local_body * Vec3::UnitX();
  return std::atan2(forward.y(), forward.x());
}

double heading_to_yaw_rad(double heading_deg) { return wrap_angle_rad((90.0 - heading_deg) * pi / 180.0); }

double wrap_angle_rad(double angle_rad) {
  const double wrapped = std::remainder(angle_rad, 2.0 * pi);
  return wrapped <= -pi ? pi : wrapped;
}

Eigen::Quaterniond level_orientation(double yaw_rad) {
  return Eigen::Quaterniond(Eigen::AngleAxisd(yaw_rad, Vec3::UnitZ()));
}

}  // namespace tileflight::vehicle
