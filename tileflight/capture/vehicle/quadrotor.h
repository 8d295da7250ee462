#pragma once

#include <array>
#include <optional>

#include "tileflight/capture/vehicle/airframe.h"

namespace tileflight::vehicle {

// The flight of a planned vehicle, a multirotor of four rotors, under the control of quadrotor.h.
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
  explicit RotorMixer(const MultirotorOptions& options);

  RotorSpeeds speeds_rad_s(const RotorDemand& demand) const;

 private:
  Eigen::Matrix4d thrusts_from_demand_;  ///< the rotors' thrusts from total thrust and torques
  double thrust_n_s2_;
  double max_thrust_n_;
};

/// Gains and limits of the control cascade. Its levels are those of AirSim's SimpleFlight and of PX4; the gains are in
/// units of motion and so do not depend on the vehicle.
struct ControllerOptions {
  double position_gain_horizontal = 1.0;      ///< velocity per distance, 1/s
  double position_gain_vertical = 1.2;        ///< the same, vertical
  double velocity_gain_horizontal = 2.6;      ///< acceleration per velocity, 1/s
  double velocity_gain_vertical = 4.0;        ///< the same, vertical
  double velocity_integral_horizontal = 0.9;  ///< acceleration per distance, 1/s^2
  double velocity_integral_vertical = 1.6;    ///< the same, vertical
  double attitude_gain = 9.0;                 ///< angular rate per angle about roll and pitch, 1/s
  double yaw_gain = 3.0;                      ///< the same about yaw
  double rate_gain = 28.0;                    ///< angular acceleration per angular rate about roll and pitch, 1/s
  double yaw_rate_gain = 12.0;                ///< the same about yaw
  double max_tilt_rad = 0.5712;               ///< pi / 5.5, SimpleFlight's
  double max_speed_m_s = 15.0;                ///< horizontal
  double max_climb_m_s = 5.0;                 ///< upwards
  double max_descent_m_s = 3.0;               ///< downwards
  double max_acceleration_m_s2 = 5.0;         ///< horizontal
  double max_rate_rad_s = 4.4;                ///< 250 degrees a second about roll and pitch
  double max_yaw_rate_rad_s = 1.6;            ///< SimpleFlight: 2.5
};

/// Wanted attitude or angular rates, whatever motion results.
struct AttitudeSetpoint {
  Eigen::Quaterniond R_local_body = Eigen::Quaterniond::Identity();  ///< body x forward, y left, z up
  std::optional<geometry::Vec3> rates_rad_s;                         ///< body axes; replaces the attitude if given
  std::optional<double> throttle;  ///< share of the rotors' total thrust; without it the setpoint's height is held
};

/// Wanted motion, local frame. On an axis that holds a position, velocity and acceleration are feed-forward terms; on
/// the others, the velocity is the target.
struct Setpoint {
  geometry::Vec3 position_m = geometry::Vec3::Zero();
  std::array<bool, 3> holds_position{false, false, false};
  geometry::Vec3 velocity_m_s = geometry::Vec3::Zero();
  geometry::Vec3 acceleration_m_s2 = geometry::Vec3::Zero();
  double yaw_rad = 0.0;  ///< of the body's x axis, counter-clockwise from east
  double yaw_rate_rad_s = 0.0;
  std::optional<AttitudeSetpoint> attitude;  ///< if given, horizontal positions and velocities are ignored
};

/// Computes the speed towards a goal `distance_m` away that comes to rest there: proportional to the distance near the
/// goal, else by constant deceleration `acceleration_m_s2` (v^2 = 2 a s), joined smoothly.
double approach_speed_m_s(double distance_m, double gain, double acceleration_m_s2);

/// Cascaded controller: position (P) gives velocity, velocity (PI) gives acceleration, acceleration and yaw give
/// attitude and thrust, attitude gives angular rate by the geometric error on SO(3) (Lee, Leok, McClamroch, 49th IEEE
/// CDC, 2010, (10)), angular rate (P) gives torques, and the mixer gives rotor speeds. The integral is frozen while
/// tilt or acceleration are at their limit.
class QuadrotorController {
 public:
  QuadrotorController(const MultirotorOptions& craft, const ControllerOptions& options);

  /// Must be called once per step.
  RotorSpeeds rotor_speeds_rad_s(const RigidBodyState& state, const Setpoint& setpoint, double step_s);
  /// Resets the integral.
  void reset() { integral_m_s2_.setZero(); }

 private:
  geometry::Vec3 desired_velocity(const RigidBodyState& state, const Setpoint& setpoint) const;
  geometry::Vec3 desired_acceleration(const RigidBodyState& state, const Setpoint& setpoint, double step_s);
  geometry::Vec3 limit_acceleration(const geometry::Vec3& acceleration_m_s2) const;
  double thrust_n(const Setpoint& setpoint, const geometry::Vec3& lift_m_s2, const geometry::Mat3& R) const;

  MultirotorOptions quadrotor_;
  ControllerOptions options_;
  RotorMixer mixer_;
  geometry::Vec3 integral_m_s2_ = geometry::Vec3::Zero();
};

/// Returns the attitude whose z axis is along `thrust_direction` and whose x axis is as close to the yaw as possible
/// (Lee et al. 2010, section IV).
Eigen::Quaterniond attitude_from_thrust(const geometry::Vec3& thrust_direction, double yaw_rad);

/// Computes half the vee of R_d^T R - R^T R_d, body axes (Lee et al. 2010, (10)): approximately the angle if that is
/// small.
geometry::Vec3 attitude_error(const geometry::Mat3& R_wanted, const geometry::Mat3& R);

/// Throws InputError if a gain or limit is not positive (integral gains: negative).
void check(const ControllerOptions& options);

}  // namespace tileflight::vehicle
