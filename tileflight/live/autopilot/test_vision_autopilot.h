#pragma once

#include <algorithm>
#include <cmath>
#include <deque>
#include <optional>
#include <vector>

#include "tileflight/live/autopilot/test_px4_client.h"

namespace tileflight::autopilot::test_support {

/// The estimator of an autopilot without a receiver: inertial navigation from a start at rest, with the barometer's
/// height until ODOMETRY comes, which then corrects position, velocity and attitude at its time stamp. NED-like axes
/// from where it stood; x where it headed.
class VisionEstimator {
 public:
  void add(const HilSensor& reading) {
    const geometry::Vec3 force = vector(reading.accelerometer_m_s2), gyro = vector(reading.gyro_rad_s);
    const double time_s = 1e-6 * static_cast<double>(reading.time_us);
    if (++readings_ <= kReadingsAtRest) return rest(force, gyro, reading.pressure_altitude_m, time_s);
    const double dt = time_s - now_.time_s;
    gyro_ = gyro - gyro_bias_;
    now_.time_s = time_s;
    now_.R = (now_.R * geometry::so3_exp(dt * gyro_)).normalized();
    const geometry::Vec3 acceleration = now_.R * force + geometry::Vec3(0, 0, vehicle::kStandardGravity_m_s2);
    now_.position_m += dt * now_.velocity_m_s + 0.5 * dt * dt * acceleration;
    now_.velocity_m_s += dt * acceleration;
    if (!sees() && (reading.updated & kBarometerUpdated) != 0) {
      const double error_m = (rest_altitude_m_ - reading.pressure_altitude_m) - now_.position_m.z();
      now_.position_m.z() += 0.02 * error_m;
      now_.velocity_m_s.z() += 0.01 * error_m;
    }
    past_.push_back(now_);
    if (past_.size() > kPast) past_.pop_front();
  }

  void add(const Odometry& seen) {
    const double time_s = 1e-6 * static_cast<double>(seen.time_us);
    const auto then = std::ranges::find_if(past_, [&](const State& one) { return one.time_s >= time_s - 1e-9; });
    if (then == past_.end()) return;
    const Eigen::Quaterniond q(seen.attitude_wxyz[0], seen.attitude_wxyz[1], seen.attitude_wxyz[2],
                               seen.attitude_wxyz[3]);
    constexpr std::uint8_t kLocalNed = 1;
    if (seen.frame == kLocalNed)
      frame_ = geometry::SE3();  // from the start, as its own, for a vehicle that heads north there
    else if (!frame_ || resets_ != seen.resets)
      begin_frame(*then, q, vector(seen.position_m), seen.resets);
    last_seen_s_ = time_s;
    const Eigen::Quaterniond R = frame_->rotation * q;
    const geometry::Vec3 position_error = *frame_ * vector(seen.position_m) - then->position_m;
    const geometry::Vec3 velocity_error = R * vector(seen.velocity_m_s) - then->velocity_m_s;
    const geometry::Vec3 turn = kAttitudeGain * geometry::so3_log(R * then->R.conjugate());
    for (auto one = then; one != past_.end(); ++one) correct(*one, position_error, velocity_error, turn);
    correct(now_, position_error, velocity_error, turn);
  }

  /// Whether vision has come of late.
  bool sees() const { return last_seen_s_ && now_.time_s - *last_seen_s_ < 0.5; }

  Observation observation() const { return {now_.time_s - 1.0, now_.position_m, now_.velocity_m_s, now_.R, gyro_}; }

 private:
  static constexpr int kReadingsAtRest = 200;
  static constexpr std::size_t kPast = 500;  ///< 2 s
  static constexpr double kPositionGain = 0.3, kVelocityGain = 0.2, kAttitudeGain = 0.05;

  struct State {
    double time_s = 0.0;
    geometry::Vec3 position_m = geometry::Vec3::Zero(), velocity_m_s = geometry::Vec3::Zero();
    Eigen::Quaterniond R = Eigen::Quaterniond::Identity();
  };

  static geometry::Vec3 vector(const std::array<float, 3>& v) { return {v[0], v[1], v[2]}; }

  /// Means at rest: tilt, gyroscope's bias and the barometer's height.
  void rest(const geometry::Vec3& force, const geometry::Vec3& gyro, double altitude_m, double time_s) {
    rest_force_ += force;
    gyro_bias_ += (gyro - gyro_bias_) / readings_;
    rest_altitude_m_ += (altitude_m - rest_altitude_m_) / readings_;
    now_.R = Eigen::Quaterniond::FromTwoVectors(rest_force_, -geometry::Vec3::UnitZ());
    now_.time_s = time_s;
  }
  /// The vision's frame, so that its pose is the own one.
  void begin_frame(const State& then, const Eigen::Quaterniond& q, const geometry::Vec3& position_m, int resets) {
    const geometry::Mat3 between = (then.R * q.conjugate()).toRotationMatrix();
    const double heading_rad = std::atan2(between(1, 0) - between(0, 1), between(0, 0) + between(1, 1));
    const Eigen::Quaterniond turn(Eigen::AngleAxisd(heading_rad, geometry::Vec3::UnitZ()));
    frame_ = geometry::SE3(turn, then.position_m - turn * position_m);
    resets_ = resets;
  }
  static void correct(State& state, const geometry::Vec3& position_error, const geometry::Vec3& velocity_error,
                      const geometry::Vec3& turn) {
    state.position_m += kPositionGain * position_error;
    state.velocity_m_s += kVelocityGain * velocity_error;
    state.R = (geometry::so3_exp(turn) * state.R).normalized();
  }

  State now_;
  std::deque<State> past_;
  geometry::Vec3 gyro_ = geometry::Vec3::Zero(), gyro_bias_ = geometry::Vec3::Zero(),
                 rest_force_ = geometry::Vec3::Zero();
  double rest_altitude_m_ = 0.0;
  int readings_ = 0, resets_ = 0;
  std::optional<geometry::SE3> frame_;
  std::optional<double> last_seen_s_;
};

/// The scripted autopilot in PX4's place, flying by its estimator; what it is told of the truth is only kept.
class VisionPx4 {
 public:
  VisionPx4(std::uint16_t port, std::vector<geometry::Vec3> points)
      : px4_(port), autopilot_(vehicle::make_airframe(vehicle::AirframeKind::kQuadX), std::move(points), 0.0) {}

  bool round() {
    if (!px4_.hear()) return false;
    if (!home_) home_ = px4_.state;
    truth_ = true_state(*home_, px4_.state);
    for (; odometries_ < px4_.odometries.size(); ++odometries_) estimator_.add(px4_.odometries[odometries_]);
    estimator_.add(px4_.sensor);
    HilActuatorControls answer;
    answer.time_us = px4_.sensor.time_us;
    const auto outputs = autopilot_.outputs(estimator_.observation(), 0.004);
    for (std::size_t i = 0; i < outputs.size(); ++i) answer.controls[i] = static_cast<float>(outputs[i]);
    answer.flags = 1;
    answer.mode = autopilot_.armed() ? 129 : 1;
    px4_.client().send(frame_of(answer, sequence_++));
    return true;
  }
  double time_s() const { return 1e-6 * static_cast<double>(px4_.sensor.time_us) - 1.0; }
  const VisionEstimator& estimator() const { return estimator_; }
  const ScriptedAutopilot& autopilot() const { return autopilot_; }
  /// At the last sensors; the autopilot does not see it.
  const Observation& truth() const { return truth_; }
  Px4Ears& ears() { return px4_; }

 private:
  Px4Ears px4_;
  std::optional<HilStateQuaternion> home_;
  Observation truth_;
  VisionEstimator estimator_;
  ScriptedAutopilot autopilot_;
  std::size_t odometries_ = 0;
  std::uint8_t sequence_ = 0;
};

/// Changes of direction at a height, for a camera and an inertial unit that look for the scale, and back.
inline std::vector<geometry::Vec3> lively_start(double height_m) {
  return {{0, 0, -height_m}, {5, 0, -height_m}, {0, 3, -height_m - 1}, {0, -3, -height_m}, {0, 0, -height_m - 1}};
}

}  // namespace tileflight::autopilot::test_support
