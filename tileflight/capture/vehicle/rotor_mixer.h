#pragma once

#include "tileflight/capture/vehicle/quadrotor.h"

namespace tileflight::vehicle {

/// Total thrust and torque that a controller demands of the rotors.
struct RotorDemand {
  double thrust_n = 0.0;                              ///< along the body's z axis
  geometry::Vec3 torque_nm = geometry::Vec3::Zero();  ///< body axes
};

/// Turns a demand into rotor speeds. If the rotors cannot deliver all of it, torque about z is reduced first, then the
/// thrust is shifted to leave room for roll and pitch, and roll and pitch are reduced only if they fit at no thrust: a
/// vehicle that can right itself can do everything else later.
class RotorMixer {
 public:
  explicit RotorMixer(const QuadrotorOptions& options);

  RotorSpeeds speeds_rad_s(const RotorDemand& demand) const;

 private:
  Eigen::Matrix4d thrusts_from_demand_;  ///< the rotors' thrusts from total thrust and torques
  double thrust_n_s2_;
  double max_thrust_n_;
};

}  // namespace tileflight::vehicle
