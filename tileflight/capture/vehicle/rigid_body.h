#pragma once

#include <functional>

#include "tileflight/core/geometry/transform.h"

namespace tileflight::vehicle {

/// Pose and velocities of a rigid body. Local frame: east, north, up. Body frame: forward, left, up (ROS's REP 103),
/// origin at the centre of mass.
struct RigidBodyState {
  geometry::Vec3 position_m = geometry::Vec3::Zero();                ///< of the centre of mass, local frame
  geometry::Vec3 velocity_m_s = geometry::Vec3::Zero();              ///< local frame
  Eigen::Quaterniond R_local_body = Eigen::Quaterniond::Identity();  ///< unit length
  geometry::Vec3 angular_velocity_rad_s = geometry::Vec3::Zero();    ///< of the body in the local frame, body axes
};

/// Mass properties of a rigid body.
struct RigidBody {
  double mass_kg = 1.0;
  geometry::Mat3 inertia_kg_m2 = geometry::Mat3::Identity();  ///< about the centre of mass, body axes
};

/// Force and torque on a rigid body.
struct Wrench {
  geometry::Vec3 force_n = geometry::Vec3::Zero();    ///< local frame
  geometry::Vec3 torque_nm = geometry::Vec3::Zero();  ///< about the centre of mass, body axes
};

/// Wrench on a body in a state, `time_s` after the start of the step.
using WrenchFunction = std::function<Wrench(const RigidBodyState& state, double time_s)>;

/// The state after `step_s`: Newton's and Euler's equations by the fourth-order Runge-Kutta method, for rotations in
/// the Lie algebra (Munthe-Kaas, BIT 38, 1998), which preserves the quaternion's unit length.
RigidBodyState integrate(const RigidBody& body, const RigidBodyState& state, double step_s,
                         const WrenchFunction& wrench);

/// Direction of the body's x axis seen from above, counter-clockwise from east, in (-pi, pi].
double yaw_rad(const Eigen::Quaterniond& R_local_body);
/// Yaw of a compass heading, degrees clockwise from north.
double heading_to_yaw_rad(double heading_deg);
/// The equivalent angle in (-pi, pi].
double wrap_angle_rad(double angle_rad);
/// Level orientation with its x axis at the yaw.
Eigen::Quaterniond level_orientation(double yaw_rad);

inline constexpr double kStandardGravity_m_s2 = 9.80665;

/// Position and direction of rotation of a rotor.
struct Rotor {
  geometry::Vec3 position_m;  ///< body frame
  double spin = 1.0;          ///< seen from above: 1 counter-clockwise, -1 clockwise
};

/// Force and torque on a vehicle by rotors, air and gravity: thrusts k w^2 along the body's z axis, reaction torques
/// against the spins (Mahony, Kumar and Corke, IEEE Robotics & Automation Magazine 19(3), 2012), and linear and
/// quadratic drag by body axis against the velocity relative to the air.
/// `options`: QuadrotorOptions, or any struct with its fields and any number of `rotors`; `speeds_rad_s`: indexed as
/// those.
template <class Options, class Speeds>
Wrench multirotor_wrench(const Options& options, const RigidBodyState& state, const Speeds& speeds_rad_s,
                         const geometry::Vec3& wind_m_s) {
  using geometry::Vec3;
  const Vec3 through_air = state.R_local_body.conjugate() * (state.velocity_m_s - wind_m_s);
  Vec3 force = -(options.linear_drag_n_s_m.cwiseProduct(through_air) +
                 options.quadratic_drag_n_s2_m2.cwiseProduct(through_air.cwiseAbs().cwiseProduct(through_air)));
  Vec3 torque = Vec3::Zero();
  for (std::size_t i = 0; i < options.rotors.size(); ++i) {
    const Rotor& rotor = options.rotors[i];
    const double squared = speeds_rad_s[i] * speeds_rad_s[i];
    const Vec3 thrust(0, 0, options.thrust_n_s2 * squared);
    force += thrust;
    torque += rotor.position_m.cross(thrust) - Vec3(0, 0, rotor.spin * options.torque_nm_s2 * squared);
  }
  return {state.R_local_body * force - Vec3(0, 0, options.body.mass_kg * kStandardGravity_m_s2), torque};
}

}  // namespace tileflight::vehicle
