#pragma once

#include <span>
#include <vector>

#include "tileflight/capture/vehicle/rigid_body.h"

namespace tileflight::vehicle {

inline constexpr double kStandardGravity_m_s2 = 9.80665;

/// Position and direction of rotation of a rotor.
struct Rotor {
  geometry::Vec3 position_m;  ///< body frame
  double spin = 1.0;          ///< seen from above: 1 counter-clockwise, -1 clockwise
};

/// Body, rotors and drag of a multirotor. Body frame: forward, left, up, from the centre of mass. The defaults are a
/// quadrotor in X form, AirSim's generic one (MIT licence; MultiRotorParams.hpp, RotorParams.hpp): a 450 mm frame with
/// GWS 9x5 propellers as the UIUC propeller database measured them. Its inertia is that of a box of 0.78 kg, 0.18 x
/// 0.11 x 0.04 m, and four motors of 0.055 kg. docs/vehicles.md has the table.
struct MultirotorOptions {
  RigidBody body{1.0, geometry::Vec3(0.00672, 0.00804, 0.01428).asDiagonal()};
  std::vector<Rotor> rotors{{{0.16087, -0.16087, 0.025}, 1.0},
                            {{-0.16087, 0.16087, 0.025}, 1.0},
                            {{0.16087, 0.16087, 0.025}, -1.0},
                            {{-0.16087, -0.16087, 0.025}, -1.0}};
  double thrust_n_s2 = 9.3144e-6;    ///< thrust per squared rotor speed, N / (rad/s)^2
  double torque_nm_s2 = 1.23827e-7;  ///< torque about the axis per squared rotor speed, Nm / (rad/s)^2
  double max_rotor_speed_rad_s = 669.86;
  double motor_time_constant_s = 0.005;                             ///< of the rotor speed's first-order lag
  geometry::Vec3 linear_drag_n_s_m = geometry::Vec3::Zero();        ///< by body axis, N / (m/s)
  geometry::Vec3 quadratic_drag_n_s2_m2{0.00659, 0.00715, 0.0366};  ///< by body axis, N / (m/s)^2

  double max_rotor_thrust_n() const { return thrust_n_s2 * max_rotor_speed_rad_s * max_rotor_speed_rad_s; }
};

/// Computes force and torque on a multirotor by rotors, air and gravity: thrusts k w^2 along the body's z axis,
/// reaction torques against the spins (Mahony, Kumar and Corke, IEEE Robotics & Automation Magazine 19(3), 2012), and
/// linear and quadratic drag by body axis against the velocity relative to the air. `speeds_rad_s`: of each rotor.
Wrench multirotor_wrench(const MultirotorOptions& options, const RigidBodyState& state,
                         std::span<const double> speeds_rad_s, const geometry::Vec3& wind_m_s);

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

/// A multirotor that an autopilot flies, with what touches the ground. Its rotors are in the order of the autopilots'
/// motor outputs.
struct Airframe : MultirotorOptions {
  std::vector<geometry::Vec3> contact_points_m;  ///< first the four feet, then propellers' tips and the top
  ContactOptions contact;
  double hull_radius_m = 0.12;  ///< of a sphere that no surface enters
};

/// Height of the centre of mass above level ground on which the vehicle stands, metres.
inline constexpr double kStandingHeight_m = 0.2;

/// Makes an airframe from the parts of MultirotorOptions' quadrotor: a box and motors on arms of 0.2275 m. Quad-X has
/// its mass of 1 kg, hexa-X 1.5 kg, so that both hover at the same rotor speed. Order and spin of the motors are those
/// of ArduPilot's frames QUAD X and HEXA X (AP_MotorsMatrix) and of PX4's quadrotor x and hexarotor x, which are the
/// same:
///
///     quad-X: 1 front right ccw, 2 rear left ccw, 3 front left cw, 4 rear right cw
///     hexa-X: 1 right cw, 2 left ccw, 3 front left cw, 4 rear right ccw, 5 front right ccw, 6 rear left cw
Airframe make_airframe(AirframeKind kind);

/// Returns the share of the full thrust that a motor output from 0 to 1 commands: (1 - expo) u + expo u^2, the form of
/// ArduPilot's MOT_THST_EXPO (default 0.65) and PX4's THR_MDL_FAC (default 0). Outputs beyond 0 to 1 are clamped, and
/// one that is not a number stops the motor.
double thrust_share(double output, double expo);

}  // namespace tileflight::vehicle
