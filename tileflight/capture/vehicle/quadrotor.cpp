#include "tileflight/capture/vehicle/quadrotor.h"

#include <Eigen/Cholesky>
#include <cmath>
#include <string>

#include "tileflight/core/base/input_error.h"

namespace tileflight::vehicle {
namespace {

using geometry::Vec3;

void require_positive(double value, const std::string& name) {
  if (!std::isfinite(value) || value <= 0.0) throw InputError("quadrotor", name + " must be more than 0");
}

}  // namespace

QuadrotorState integrate(const MultirotorOptions& options, const QuadrotorState& state,
                         const RotorSpeeds& commanded_rad_s, const Vec3& wind_m_s, double step_s) {
  const RotorSpeeds target = commanded_rad_s.max(0.0).min(options.max_rotor_speed_rad_s);
  const auto speeds_at = [&](double time_s) -> RotorSpeeds {
    return target + (state.rotor_speeds_rad_s - target) * std::exp(-time_s / options.motor_time_constant_s);
  };
  const auto wrench = [&](const RigidBodyState& body, double time_s) {
    const RotorSpeeds speeds = speeds_at(time_s);
    return multirotor_wrench(options, body, {speeds.data(), kRotors}, wind_m_s);
  };
  return {integrate(options.body, state.body, step_s, wrench), speeds_at(step_s)};
}

double hover_rotor_speed_rad_s(const MultirotorOptions& options) {
  return std::sqrt(options.body.mass_kg * kStandardGravity_m_s2 / (kRotors * options.thrust_n_s2));
}

void check(const MultirotorOptions& options) {
  if (options.rotors.size() != kRotors) throw InputError("quadrotor", "must have four rotors");
  require_positive(options.body.mass_kg, "the mass");
  require_positive(options.thrust_n_s2, "the thrust coefficient");
  require_positive(options.torque_nm_s2, "the torque coefficient");
  require_positive(options.max_rotor_speed_rad_s, "the greatest rotor speed");
  require_positive(options.motor_time_constant_s, "the motors' time constant");
  if (!options.body.inertia_kg_m2.allFinite() ||
      Eigen::LLT<geometry::Mat3>(options.body.inertia_kg_m2).info() != Eigen::Success)
    throw InputError("quadrotor", "the inertia must be positive about every axis");
  const Vec3 drag = options.linear_drag_n_s_m.cwiseMin(options.quadratic_drag_n_s2_m2);
  if (!drag.allFinite() || drag.minCoeff() < 0.0) throw InputError("quadrotor", "drag must not be negative");
  if (kRotors * options.max_rotor_thrust_n() < 1.1 * options.body.mass_kg * kStandardGravity_m_s2)
    throw InputError("quadrotor", "the rotors cannot lift it: their thrust must exceed its weight by at least 10 %");
}

}  // namespace tileflight::vehicle
