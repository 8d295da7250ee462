#pragma once

#include <vector>

#include "tileflight/capture/vehicle/quadrotor.h"

namespace tileflight::vehicle {

/// Arrangement of the rotors.
enum class AirframeKind {
  kQuadX,
  kHexaX,
};

/// Stiffness, damping and friction of what touches the ground.
struct ContactOptions {
  double stiffness_n_m = 2000.0;  ///< of each point, along the surface's normal and across it
  double damping_n_s_m = 22.0;    ///< of each point
  double friction = 0.7;          ///< Coulomb's coefficient: rubber on a paved ground
};

/// A multirotor that an autopilot flies. Body frame: forward, left, up, from the centre of mass.
struct Airframe {
  vehicle::RigidBody body;
  std::vector<vehicle::Rotor> rotors;  ///< in the order of the autopilots' motor outputs
  double thrust_n_s2 = 0.0, torque_nm_s2 = 0.0, max_rotor_speed_rad_s = 0.0, motor_time_constant_s = 0.0;
  geometry::Vec3 linear_drag_n_s_m = geometry::Vec3::Zero(), quadratic_drag_n_s2_m2 = geometry::Vec3::Zero();
  std::vector<geometry::Vec3> contact_points_m;  ///< first the four feet, then propellers' tips and the top
  ContactOptions contact;
  double hull_radius_m = 0.12;  ///< of a sphere that no surface enters
};

/// Height of the centre of mass above level ground on which the vehicle stands, metres.
inline constexpr double kStandingHeight_m = 0.2;

/// An airframe made of the parts of vehicle::QuadrotorOptions: a box and motors on arms of 0.2275 m. Quad-X has its
/// mass of 1 kg, hexa-X 1.5 kg, so that both hover at the same rotor speed. Order and spin of the motors are those of
/// ArduPilot's frames QUAD X and HEXA X (AP_MotorsMatrix) and of PX4's quadrotor x and hexarotor x, which are the same:
///
///     quad-X: 1 front right ccw, 2 rear left ccw, 3 front left cw, 4 rear right cw
///     hexa-X: 1 right cw, 2 left ccw, 3 front left cw, 4 rear right ccw, 5 front right ccw, 6 rear left cw
Airframe make_airframe(AirframeKind kind);

/// The share of the full thrust that a motor output from 0 to 1 commands: (1 - expo) u + expo u^2, the form of
/// ArduPilot's MOT_THST_EXPO (default 0.65) and PX4's THR_MDL_FAC (default 0). Outputs beyond 0 to 1 are clamped, and
/// one that is not a number stops the motor.
double thrust_share(double output, double expo);

}  // namespace tileflight::vehicle
