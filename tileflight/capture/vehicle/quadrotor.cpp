#include "tileflight/capture/vehicle/quadrotor.h"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <string>

#include "tileflight/core/base/input_error.h"

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

RotorMixer::RotorMixer(const MultirotorOptions& options)
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

namespace {

using geometry::Mat3;
using geometry::Vec2;
using geometry::Vec3;

/// Minimum lift while descending, as a share of gravity: without thrust the vehicle cannot turn.
constexpr double kMinLift = 0.2;
/// Maximum thrust as a share of the rotors' total: the rest is for torques.
constexpr double kMaxThrustShare = 0.9;

Vec2 clamp_norm(const Vec2& v, double longest) {
  const double length = v.norm();
  return length > longest ? Vec2(v * (longest / length)) : v;
}

}  // namespace

double approach_speed_m_s(double distance_m, double gain, double acceleration_m_s2) {
  const double linear_m = acceleration_m_s2 / (gain * gain);
  if (distance_m <= linear_m) return gain * distance_m;
  return std::sqrt(2.0 * acceleration_m_s2 * (distance_m - linear_m / 2.0));
}

Eigen::Quaterniond attitude_from_thrust(const Vec3& thrust_direction, double yaw_rad) {
  const Vec3 z = thrust_direction.normalized();
  const Vec3 y = z.cross(Vec3(std::cos(yaw_rad), std::sin(yaw_rad), 0.0)).normalized();
  Mat3 R;
  R << y.cross(z), y, z;
  return Eigen::Quaterniond(R);
}

Vec3 attitude_error(const Mat3& R_wanted, const Mat3& R) {
  const Mat3 difference = R_wanted.transpose() * R - R.transpose() * R_wanted;
  return 0.5 * Vec3(difference(2, 1), difference(0, 2), difference(1, 0));
}

QuadrotorController::QuadrotorController(const MultirotorOptions& craft, const ControllerOptions& options)
    : quadrotor_(craft), options_(options), mixer_(craft) {}

Vec3 QuadrotorController::desired_velocity(const RigidBodyState& state, const Setpoint& setpoint) const {
  const ControllerOptions& o = options_;
  Vec3 error = setpoint.position_m - state.position_m;
  for (int axis = 0; axis < 3; ++axis) error[axis] = setpoint.holds_position[axis] ? error[axis] : 0.0;
  const double distance_m = error.head<2>().norm();
  Vec3 velocity = setpoint.velocity_m_s;
  if (distance_m > 0.0) {
    const double speed = approach_speed_m_s(distance_m, o.position_gain_horizontal, 0.7 * o.max_acceleration_m_s2);
    velocity.head<2>() += error.head<2>() / distance_m * speed;
  }
  velocity.z() += o.position_gain_vertical * error.z();
  velocity.head<2>() = clamp_norm(velocity.head<2>(), o.max_speed_m_s);
  velocity.z() = std::clamp(velocity.z(), -o.max_descent_m_s, o.max_climb_m_s);
  return velocity;
}

/// Limits the acceleration to what tilt and thrust can provide.
Vec3 QuadrotorController::limit_acceleration(const Vec3& acceleration_m_s2) const {
  const double most_lift = kMaxThrustShare * kRotors * quadrotor_.max_rotor_thrust_n() / quadrotor_.body.mass_kg *
                           std::cos(options_.max_tilt_rad);
  const double lift = std::clamp(kStandardGravity_m_s2 + acceleration_m_s2.z(), kMinLift * kStandardGravity_m_s2,
                                 std::max(most_lift, 1.02 * kStandardGravity_m_s2));
  Vec3 limited;
  limited.head<2>() = clamp_norm(acceleration_m_s2.head<2>(),
                                 std::min(options_.max_acceleration_m_s2, lift * std::tan(options_.max_tilt_rad)));
  limited.z() = lift - kStandardGravity_m_s2;
  return limited;
}

Vec3 QuadrotorController::desired_acceleration(const RigidBodyState& state, const Setpoint& setpoint, double step_s) {
  const ControllerOptions& o = options_;
  const Vec3 error = desired_velocity(state, setpoint) - state.velocity_m_s;
  const Vec3 gain(o.velocity_gain_horizontal, o.velocity_gain_horizontal, o.velocity_gain_vertical);
  const Vec3 desired = setpoint.acceleration_m_s2 + gain.cwiseProduct(error) + integral_m_s2_;
  const Vec3 achievable = limit_acceleration(desired);
  const Vec3 integral_gain(o.velocity_integral_horizontal, o.velocity_integral_horizontal,
                           o.velocity_integral_vertical);
  const int first = !setpoint.attitude            ? 0
                    : setpoint.attitude->throttle ? 3
                                                  : 2;  // the integral ignores axes that are not controlled
  for (int axis = first; axis < 3; ++axis) {
    const bool at_limit =
        std::abs(desired[axis] - achievable[axis]) > 1e-9 && (desired[axis] - achievable[axis]) * error[axis] > 0;
    if (!at_limit) integral_m_s2_[axis] += integral_gain[axis] * error[axis] * step_s;
  }
  return achievable;
}

double QuadrotorController::thrust_n(const Setpoint& setpoint, const Vec3& lift_m_s2, const Mat3& R) const {
  const double mass_kg = quadrotor_.body.mass_kg;
  if (!setpoint.attitude) return mass_kg * std::max(0.0, lift_m_s2.dot(R.col(2)));  // Lee et al. 2010, (15)
  if (setpoint.attitude->throttle) return *setpoint.attitude->throttle * kRotors * quadrotor_.max_rotor_thrust_n();
  return mass_kg * lift_m_s2.z() / std::max(R(2, 2), std::cos(options_.max_tilt_rad));  // holds the height
}

RotorSpeeds QuadrotorController::rotor_speeds_rad_s(const RigidBodyState& state, const Setpoint& setpoint,
                                                    double step_s) {
  const ControllerOptions& o = options_;
  const Mat3& J = quadrotor_.body.inertia_kg_m2;
  const Vec3 lift = desired_acceleration(state, setpoint, step_s) + Vec3(0, 0, kStandardGravity_m_s2);
  const Mat3 R = state.R_local_body.toRotationMatrix();
  const Mat3 R_wanted =
      (setpoint.attitude ? setpoint.attitude->R_local_body : attitude_from_thrust(lift, setpoint.yaw_rad))
          .toRotationMatrix();

  const Vec3 turning = Vec3(o.attitude_gain, o.attitude_gain, o.yaw_gain).cwiseProduct(attitude_error(R_wanted, R));
  Vec3 rate = R.transpose() * Vec3(0, 0, setpoint.yaw_rate_rad_s) - turning;
  if (setpoint.attitude && setpoint.attitude->rates_rad_s) rate = *setpoint.attitude->rates_rad_s;
  const Vec3 most_rate(o.max_rate_rad_s, o.max_rate_rad_s, o.max_yaw_rate_rad_s);
  rate = rate.cwiseMax(-most_rate).cwiseMin(most_rate);

  const Vec3& w = state.angular_velocity_rad_s;
  const Vec3 angular_acceleration = Vec3(o.rate_gain, o.rate_gain, o.yaw_rate_gain).cwiseProduct(rate - w);
  return mixer_.speeds_rad_s({thrust_n(setpoint, lift, R), J * angular_acceleration + w.cross(J * w)});
}

void check(const ControllerOptions& o) {
  for (const double value :
       {o.position_gain_horizontal, o.position_gain_vertical, o.velocity_gain_horizontal, o.velocity_gain_vertical,
        o.attitude_gain, o.yaw_gain, o.rate_gain, o.yaw_rate_gain, o.max_tilt_rad, o.max_speed_m_s, o.max_climb_m_s,
        o.max_descent_m_s, o.max_acceleration_m_s2, o.max_rate_rad_s, o.max_yaw_rate_rad_s})
    if (!std::isfinite(value) || value <= 0.0) throw InputError("controller", "gains and limits must be more than 0");
  if (!(o.velocity_integral_horizontal >= 0.0) || !(o.velocity_integral_vertical >= 0.0))
    throw InputError("controller", "integral gains must not be negative");
  if (o.max_tilt_rad > 1.2) throw InputError("controller", "the greatest tilt must be under 1.2 rad");
}

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
