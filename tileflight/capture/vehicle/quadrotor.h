#pragma once

#include "tileflight/capture/vehicle/airframe.h"

namespace tileflight::vehicle {

// The flight of a planned vehicle, a multirotor of four rotors, under the control of quadrotor_controller.h.
inline constexpr int kRotors = 4;

using RotorSpeeds = Eigen::Array<double, kRotors, 1>;  ///< radians per second, not negative

/// State of a quadrotor: its body and its rotor speeds.
struct QuadrotorState {
  RigidBodyState body;
  RotorSpeeds rotor_speeds_rad_s = RotorSpeeds::Zero();
};

/// Computes the state after `step_s`. Commanded speeds (clamped to the motors' limits) and wind are constant during the
/// step; rotor speeds follow with a first-order lag, in closed form.
QuadrotorState integrate(const MultirotorOptions& options, const QuadrotorState& state,
                         const RotorSpeeds& commanded_rad_s, const geometry::Vec3& wind_m_s, double step_s);

/// Returns the speed of each rotor when hovering in still air.
double hover_rotor_speed_rad_s(const MultirotorOptions& options);

/// Throws InputError if there are not four rotors, a number is not finite, or not positive where it must be, or the
/// vehicle cannot lift itself.
void check(const MultirotorOptions& options);

}  // namespace tileflight::vehicle
