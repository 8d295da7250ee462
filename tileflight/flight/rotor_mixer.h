#pragma once

#include "tileflight/flight/quadrotor.h"

namespace tileflight::flight {

/// What a controller wants of the rotors together.
struct RotorDemand {
  double thrust_n = 0.0;                              ///< along the body's z axis
  geometry::Vec3 torque_nm = geometry::Vec3::Zero();  ///< body axes
};

/// Turns a demand into rotor speeds. Where the rotors cannot give all of it, turning about z gives way first, then the
/// thrust moves to where roll and pitch have room, and only what fits at no thrust is taken from roll and pitch: a
/// craft that can turn upright can do all else later.
class RotorMixer {
 public:
  explicit RotorMixer(const QuadrotorOptions& options);

  RotorSpeeds speeds_rad_s(const RotorDemand& demand) const;
  /// What rotors at these speeds give.
  RotorDemand given(const RotorSpeeds& speeds_rad_s) const;

 private:
  Eigen::Matrix4d demand_of_thrusts_;  ///< thrust and torques from the rotors' thrusts
  Eigen::Matrix4d thrusts_of_demand_;
  double thrust_n_s2_;
  double max_thrust_n_;
};

}  // namespace tileflight::flight
