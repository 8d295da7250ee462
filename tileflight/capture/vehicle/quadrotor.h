#pragma once

#include <array>

#include "tileflight/capture/vehicle/rigid_body.h"

namespace tileflight::vehicle {

inline constexpr int kRotors = 4;

using RotorSpeeds = Eigen::Array<double, kRotors, 1>;  ///< radians per second, not negative

/// A quadrotor in X form: AirSim's generic one (MIT licence; MultiRotorParams.hpp, RotorParams.hpp), a 450 mm frame
/// with GWS 9x5 propellers as the UIUC propeller database measured them. Inertia: a box of 0.78 kg, 0.18 x 0.11 x 0.04
/// m, and four motors of 0.055 kg. docs/vehicles.md has the table.
struct QuadrotorOptions {
  RigidBody body{1.0, geometry::Vec3(0.00672, 0.00804, 0.01428).asDiagonal()};
  std::array<Rotor, kRotors> rotors{{{{0.16087, -0.16087, 0.025}, 1.0},
                                     {{-0.16087, 0.16087, 0.025}, 1.0},
                                     {{0.16087, 0.16087, 0.025}, -1.0},
                                     {{-0.16087, -0.16087, 0.025}, -1.0}}};
  double thrust_n_s2 = 9.3144e-6;    ///< thrust per squared rotor speed, N / (rad/s)^2
  double torque_nm_s2 = 1.23827e-7;  ///< torque about the axis per squared rotor speed, Nm / (rad/s)^2
  double max_rotor_speed_rad_s = 669.86;
  double motor_time_constant_s = 0.005;                             ///< of the rotor speed's first-order lag
  geometry::Vec3 linear_drag_n_s_m = geometry::Vec3::Zero();        ///< by body axis, N / (m/s)
  geometry::Vec3 quadratic_drag_n_s2_m2{0.00659, 0.00715, 0.0366};  ///< by body axis, N / (m/s)^2

  double max_rotor_thrust_n() const { return thrust_n_s2 * max_rotor_speed_rad_s * max_rotor_speed_rad_s; }
};

/// State of a quadrotor: its body and its rotor speeds.
struct QuadrotorState {
  RigidBodyState body;
  RotorSpeeds rotor_speeds_rad_s = RotorSpeeds::Zero();
};

/// multirotor_wrench() of a quadrotor.
Wrench quadrotor_wrench(const QuadrotorOptions& options, const RigidBodyState& state, const RotorSpeeds& speeds_rad_s,
                        const geometry::Vec3& wind_m_s);

/// The state after `step_s`. Commanded speeds (clamped to the motors' limits) and wind are constant during the step;
/// rotor speeds follow with a first-order lag, in closed form.
QuadrotorState integrate(const QuadrotorOptions& options, const QuadrotorState& state,
                         const RotorSpeeds& commanded_rad_s, const geometry::Vec3& wind_m_s, double step_s);

/// Speed of each rotor when hovering in still air.
double hover_rotor_speed_rad_s(const QuadrotorOptions& options);

/// Throws InputError if a number is not finite, or not positive where it must be, or the vehicle cannot lift itself.
void check(const QuadrotorOptions& options);

}  // namespace tileflight::vehicle
