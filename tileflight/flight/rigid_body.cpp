#include "tileflight/flight/rigid_body.h"

#include <cmath>
#include <numbers>

namespace tileflight::flight {
namespace {

using geometry::Mat3;
using geometry::Vec3;
using std::numbers::pi;

/// Changes of position, velocity, rotation vector and angular velocity.
struct Change {
  Vec3 position = Vec3::Zero(), velocity = Vec3::Zero(), rotation = Vec3::Zero(), rate = Vec3::Zero();

  Change operator*(double s) const { return {s * position, s * velocity, s * rotation, s * rate}; }
  Change operator+(const Change& o) const {
    return {position + o.position, velocity + o.velocity, rotation + o.rotation, rate + o.rate};
  }
};

RigidBodyState moved(const RigidBodyState& s, const Change& c) {
  return {s.position_m + c.position, s.velocity_m_s + c.velocity,
          (s.R_local_body * geometry::so3_exp(c.rotation)).normalized(), s.angular_velocity_rad_s + c.rate};
}

/// How the rotation vector theta of R exp(theta) changes under the rate w: theta' = w + theta x w / 2 + theta x (theta
/// x w) / 12 + O(theta^4), the inverse of the exponential's differential (Munthe-Kaas 1998, (9), for body rates).
Vec3 rotation_vector_rate(const Vec3& theta, const Vec3& w) {
  const Vec3 cross = theta.cross(w);
  return w + cross / 2.0 + theta.cross(cross) / 12.0;
}

}  // namespace

RigidBodyState advanced(const RigidBody& body, const RigidBodyState& state, double step_s,
                        const WrenchFunction& wrench) {
  const Mat3& J = body.inertia_kg_m2;
  const Mat3 J_inverse = J.inverse();
  const auto derivative = [&](const Change& since, double time_s) {
    const RigidBodyState at = moved(state, since);
    const Wrench w = wrench(at, time_s);
    const Vec3& rate = at.angular_velocity_rad_s;
    return Change{at.velocity_m_s, w.force_n / body.mass_kg, rotation_vector_rate(since.rotation, rate),
                  J_inverse * (w.torque_nm - rate.cross(J * rate))};  // Euler's equations
  };
  const double h = step_s;
  const Change k1 = derivative({}, 0.0);
  const Change k2 = derivative(k1 * (h / 2), h / 2);
  const Change k3 = derivative(k2 * (h / 2), h / 2);
  const Change k4 = derivative(k3 * h, h);
  return moved(state, (k1 + (k2 + k3) * 2.0 + k4) * (h / 6.0));
}

double kinetic_energy_j(const RigidBody& body, const RigidBodyState& state) {
  const Vec3& w = state.angular_velocity_rad_s;
  return 0.5 * body.mass_kg * state.velocity_m_s.squaredNorm() + 0.5 * w.dot(body.inertia_kg_m2 * w);
}

Vec3 angular_momentum(const RigidBody& body, const RigidBodyState& state) {
  return state.R_local_body * (body.inertia_kg_m2 * state.angular_velocity_rad_s);
}

double yaw_rad(const Eigen::Quaterniond& R_local_body) {
  const Vec3 forward = R_local_body * Vec3::UnitX();
  return std::atan2(forward.y(), forward.x());
}

double yaw_of_heading_rad(double heading_deg) { return wrapped_rad((90.0 - heading_deg) * pi / 180.0); }

double heading_of_yaw_deg(double yaw_rad) {
  const double heading = std::fmod(90.0 - yaw_rad * 180.0 / pi, 360.0);
  return heading < 0.0 ? heading + 360.0 : heading;
}

double wrapped_rad(double angle_rad) {
  const double wrapped = std::remainder(angle_rad, 2.0 * pi);
  return wrapped <= -pi ? pi : wrapped;
}

Eigen::Quaterniond level_orientation(double yaw_rad) {
  return Eigen::Quaterniond(Eigen::AngleAxisd(yaw_rad, Vec3::UnitZ()));
}

}  // namespace tileflight::flight
