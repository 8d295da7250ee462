#include "tileflight/capture/vehicle/rotor_mixer.h"

#include <Eigen/LU>
#include <algorithm>

namespace tileflight::vehicle {
namespace {

using Thrusts = Eigen::Vector4d;

/// Largest factor in [0, 1] by which `extra` can be added to `base` within the rotors' limits.
double feasible_share(const Thrusts& base, const Thrusts& extra, double max_n) {
  double share = 1.0;
  for (int i = 0; i < kRotors; ++i) {
    if (extra[i] > 0.0) share = std::min(share, (max_n - base[i]) / extra[i]);
    if (extra[i] < 0.0) share = std::min(share, -base[i] / extra[i]);
  }
  return std::max(0.0, share);
}

}  // namespace

RotorMixer::RotorMixer(const QuadrotorOptions& options)
    : thrust_n_s2_(options.thrust_n_s2), max_thrust_n_(options.max_rotor_thrust_n()) {
  Eigen::Matrix4d demand_from_thrusts;
  for (int i = 0; i < kRotors; ++i) {
    const Rotor& rotor = options.rotors[i];
    demand_from_thrusts.col(i) << 1.0, rotor.position_m.y(), -rotor.position_m.x(),
        -rotor.spin * options.torque_nm_s2 / options.thrust_n_s2;
  }
  thrusts_from_demand_ = demand_from_thrusts.inverse();
}

RotorSpeeds RotorMixer::speeds_rad_s(const RotorDemand& demand) const {
  const Eigen::Vector3d& torque = demand.torque_nm;
  Thrusts tilting = thrusts_from_demand_ * Eigen::Vector4d(0.0, torque.x(), torque.y(), 0.0);
  const Thrusts turning = thrusts_from_demand_ * Eigen::Vector4d(0.0, 0.0, 0.0, torque.z());
  const double spread = tilting.maxCoeff() - tilting.minCoeff();
  if (spread > max_thrust_n_) tilting *= max_thrust_n_ / spread;
  const double lift = std::clamp(demand.thrust_n / kRotors, -tilting.minCoeff(),
                                 std::max(-tilting.minCoeff(), max_thrust_n_ - tilting.maxCoeff()));
  const Thrusts base = tilting + Thrusts::Constant(lift);
  const Thrusts thrusts = base + feasible_share(base, turning, max_thrust_n_) * turning;
  return (thrusts.array().max(0.0) / thrust_n_s2_).sqrt();
}

}  // namespace tileflight::vehicle
