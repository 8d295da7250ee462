#pragma once

#include "tileflight/capture/vehicle/rigid_body.h"

namespace tileflight::vehicle {

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
