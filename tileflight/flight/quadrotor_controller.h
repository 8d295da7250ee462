#pragma once

#include <array>
#include <optional>

#include "tileflight/flight/rotor_mixer.h"

namespace tileflight::flight {

/// Gains and limits of the cascade. The levels are those of AirSim's SimpleFlight and of PX4; the gains are in units of
/// motion, so that they do not depend on the craft.
struct ControllerOptions {
  double position_gain_level = 1.0;      ///< velocity per distance, 1/s
  double position_gain_up = 1.2;         ///< the same upwards
  double velocity_gain_level = 2.6;      ///< acceleration per velocity, 1/s
  double velocity_gain_up = 4.0;         ///< the same upwards
  double velocity_integral_level = 0.9;  ///< acceleration per distance, 1/s^2
  double velocity_integral_up = 1.6;     ///< the same upwards
  double attitude_gain = 9.0;            ///< turning rate per angle about roll and pitch, 1/s
  double yaw_gain = 3.0;                 ///< the same about yaw
  double rate_gain = 28.0;               ///< angular acceleration per rate about roll and pitch, 1/s
  double yaw_rate_gain = 12.0;           ///< the same about yaw
  double max_tilt_rad = 0.5712;          ///< pi / 5.5, SimpleFlight's
  double max_speed_m_s = 15.0;           ///< level
  double max_climb_m_s = 5.0;            ///< up
  double max_descent_m_s = 3.0;          ///< down
  double max_acceleration_m_s2 = 5.0;    ///< level
  double max_rate_rad_s = 4.4;           ///< 250 degrees a second about roll and pitch
  double max_yaw_rate_rad_s = 1.6;       ///< SimpleFlight: 2.5
};

/// How the craft should lie or turn, wherever that takes it.
struct LeanSetpoint {
  Eigen::Quaterniond R_local_body = Eigen::Quaterniond::Identity();  ///< body x forward, y left, z up
  std::optional<geometry::Vec3> rates_rad_s;                         ///< body axes; if given, instead of the attitude
  std::optional<double> throttle;  ///< share of what all rotors give; not given: the setpoint's height is held
};

/// What the craft should do now, local frame. Along an axis that holds a position, velocity and acceleration are fed
/// forward; along one that does not, the velocity is the wanted one.
struct Setpoint {
  geometry::Vec3 position_m = geometry::Vec3::Zero();
  std::array<bool, 3> holds_position{false, false, false};
  geometry::Vec3 velocity_m_s = geometry::Vec3::Zero();
  geometry::Vec3 acceleration_m_s2 = geometry::Vec3::Zero();
  double yaw_rad = 0.0;  ///< of the body's x axis, counter-clockwise from east
  double yaw_rate_rad_s = 0.0;
  std::optional<LeanSetpoint> lean;  ///< then level positions and velocities are not heeded
};

/// How fast to go towards a goal `distance_m` away so as to come to rest there: proportional near it, else by the even
/// slowing down `acceleration_m_s2` (v^2 = 2 a s), joined smoothly.
double approach_speed_m_s(double distance_m, double gain, double acceleration_m_s2);

/// Position (P) gives velocity, velocity (PI) acceleration, acceleration and yaw an attitude and a thrust, attitude a
/// turning rate by the geometric error on SO(3) (Lee, Leok, McClamroch, 49th IEEE CDC, 2010, (10)), the rate (P)
/// torques, the mixer rotor speeds. The integral stops where tilt or acceleration are at their limit.
class QuadrotorController {
 public:
  QuadrotorController(const QuadrotorOptions& craft, const ControllerOptions& options);

  /// Call once a step.
  RotorSpeeds rotor_speeds_rad_s(const RigidBodyState& state, const Setpoint& setpoint, double step_s);
  /// Forgets the integral.
  void reset() { integral_m_s2_.setZero(); }

  const ControllerOptions& options() const { return options_; }

 private:
  geometry::Vec3 wanted_velocity(const RigidBodyState& state, const Setpoint& setpoint) const;
  geometry::Vec3 wanted_acceleration(const RigidBodyState& state, const Setpoint& setpoint, double step_s);
  geometry::Vec3 within_limits(const geometry::Vec3& acceleration_m_s2) const;
  double thrust_n(const Setpoint& setpoint, const geometry::Vec3& lift_m_s2, const geometry::Mat3& R) const;

  QuadrotorOptions craft_;
  ControllerOptions options_;
  RotorMixer mixer_;
  geometry::Vec3 integral_m_s2_ = geometry::Vec3::Zero();
};

/// The attitude whose z axis is along `thrust_direction` and whose x axis points to the yaw as nearly as it can (Lee et
/// al. 2010, section IV).
Eigen::Quaterniond attitude_of(const geometry::Vec3& thrust_direction, double yaw_rad);

/// Half the vee of R_d^T R - R^T R_d, body axes (Lee et al. 2010, (10)): about the angle where that is small.
geometry::Vec3 attitude_error(const geometry::Mat3& R_wanted, const geometry::Mat3& R);

/// Throws InputError where a gain or limit is not positive (integrals: negative).
void check(const ControllerOptions& options);

}  // namespace tileflight::flight
