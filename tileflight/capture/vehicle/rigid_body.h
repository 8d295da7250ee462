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

/// Computes the state after `step_s`: Newton's and Euler's equations by the fourth-order Runge-Kutta method, for
/// rotations in the Lie algebra (Munthe-Kaas, BIT 38, 1998), which preserves the quaternion's unit length.
RigidBodyState integrate(const RigidBody& body, const RigidBodyState& state, double step_s,
                         const WrenchFunction& wrench);

/// Returns the direction of the body's x axis seen from above, counter-clockwise from east, in (-pi, pi].
double yaw_rad(const Eigen::Quaterniond& R_local_body);
/// Converts a compass heading, degrees clockwise from north, to a yaw.
double heading_to_yaw_rad(double heading_deg);
/// Wraps an angle into (-pi, pi].
double wrap_angle_rad(double angle_rad);
/// Returns the level orientation with its x axis at the yaw.
Eigen::Quaterniond level_orientation(double yaw_rad);

}  // namespace tileflight::vehicle
