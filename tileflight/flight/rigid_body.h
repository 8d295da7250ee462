#pragma once

#include <functional>

#include "tileflight/geometry/transform.h"

namespace tileflight::flight {

/// Where a rigid body is and how it moves. Local frame: east, north, up. Body frame: forward, left, up (ROS's REP 103),
/// from the centre of mass.
struct RigidBodyState {
  geometry::Vec3 position_m = geometry::Vec3::Zero();                ///< of the centre of mass, local frame
  geometry::Vec3 velocity_m_s = geometry::Vec3::Zero();              ///< local frame
  Eigen::Quaterniond R_local_body = Eigen::Quaterniond::Identity();  ///< unit length
  geometry::Vec3 angular_velocity_rad_s = geometry::Vec3::Zero();    ///< of the body in the local frame, body axes
};

struct RigidBody {
  double mass_kg = 1.0;
  geometry::Mat3 inertia_kg_m2 = geometry::Mat3::Identity();  ///< about the centre of mass, body axes
};

struct Wrench {
  geometry::Vec3 force_n = geometry::Vec3::Zero();    ///< local frame
  geometry::Vec3 torque_nm = geometry::Vec3::Zero();  ///< about the centre of mass, body axes
};

/// What acts on a body in a state, `time_s` after the step began.
using WrenchFunction = std::function<Wrench(const RigidBodyState& state, double time_s)>;

/// The state `step_s` later: Newton's and Euler's equations by the Runge-Kutta method of order four, for the rotation
/// in the Lie algebra (Munthe-Kaas, BIT 38, 1998), which keeps the quaternion's unit length by itself.
RigidBodyState advanced(const RigidBody& body, const RigidBodyState& state, double step_s,
                        const WrenchFunction& wrench);

double kinetic_energy_j(const RigidBody& body, const RigidBodyState& state);
/// About the centre of mass, local frame, kg m^2/s.
geometry::Vec3 angular_momentum(const RigidBody& body, const RigidBodyState& state);

/// Direction of the body's x axis seen from above, counter-clockwise from east, in (-pi, pi].
double yaw_rad(const Eigen::Quaterniond& R_local_body);
/// That of a compass heading, degrees clockwise from north; and back, in [0, 360).
double yaw_of_heading_rad(double heading_deg);
double heading_of_yaw_deg(double yaw_rad);
/// An angle's equal in (-pi, pi].
double wrapped_rad(double angle_rad);
/// Level, with its x axis at the yaw.
Eigen::Quaterniond level_orientation(double yaw_rad);

}  // namespace tileflight::flight
