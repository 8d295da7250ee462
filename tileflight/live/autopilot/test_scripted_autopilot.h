#pragma once

#include <Eigen/QR>
#include <algorithm>
#include <cmath>
#include <vector>

#include "tileflight/capture/vehicle/airframe.h"

namespace tileflight::autopilot::test_support {

/// State that the scripted autopilot observes: NED, body axes forward, right, down.
struct Observation {
  double time_s = 0.0;
  geometry::Vec3 position_m = geometry::Vec3::Zero(), velocity_m_s = geometry::Vec3::Zero();
  Eigen::Quaterniond R_ned_body = Eigen::Quaterniond::Identity();
  geometry::Vec3 gyro_rad_s = geometry::Vec3::Zero();
};

/// An autopilot for tests, knowing nothing but its airframe and what it is told: position (P) -> velocity (PI) ->
/// attitude and thrust -> body rates (P) -> torques -> motors. It arms, takes off, flies to each point, comes back and
/// lands.
class ScriptedAutopilot {
 public:
  /// `points_ned_m`: from the start. `thrust_expo`: of the motors.
  ScriptedAutopilot(const vehicle::Airframe& airframe, std::vector<geometry::Vec3> points_ned_m, double thrust_expo)
      : airframe_(airframe), points_(std::move(points_ned_m)), expo_(thrust_expo) {
    Eigen::MatrixXd demand(4, airframe_.rotors.size());  // thrust and torques of a newton of each rotor
    for (std::size_t i = 0; i < airframe_.rotors.size(); ++i) {
      const vehicle::Rotor& rotor = airframe_.rotors[i];
      // Forward, left, up to forward, right, down: y and z change their sign.
      demand.col(static_cast<Eigen::Index>(i)) << 1.0, rotor.position_m.y(), rotor.position_m.x(),
          rotor.spin * airframe_.torque_nm_s2 / airframe_.thrust_n_s2;
    }
    thrusts_from_demand_ = demand.completeOrthogonalDecomposition().pseudoInverse();
  }

  /// Motor outputs, 0 to 1, for the next step.
  std::vector<double> outputs(const Observation& now, double step_s) {
    update_goal(now);
    if (!flying_) return std::vector<double>(airframe_.rotors.size(), 0.0);
    const geometry::Vec3 thrust_n = wanted_thrust_n(now, step_s);
    return mix(-thrust_n.dot(now.R_ned_body * geometry::Vec3::UnitZ()), wanted_torque_nm(now, thrust_n));
  }

  bool armed() const { return flying_; }
  bool landed() const { return landed_; }
  std::size_t points_reached() const { return next_; }

 private:
  static constexpr double kArmAt_s = 1.0, kReached_m = 0.5, kDescent_m_s = 0.5;

  void update_goal(const Observation& now) {
    if (landed_) return;
    if (!flying_) {
      flying_ = now.time_s >= kArmAt_s;
      goal_ = now.position_m + geometry::Vec3(0, 0, points_.empty() ? -2.0 : points_.front().z());
      home_ = now.position_m;
    }
    if (next_ < points_.size()) {
      goal_ = home_ + points_[next_];
      if ((now.position_m - goal_).norm() < kReached_m) ++next_;
      return;
    }
    goal_ = geometry::Vec3(home_.x(), home_.y(), goal_.z());
    const bool over_home = (now.position_m - home_).head<2>().norm() < kReached_m;
    if (over_home && !descending_) {
      descending_ = true;
      descent_since_s_ = now.time_s;
    }
    const bool on_ground = descending_ && now.time_s > descent_since_s_ + 2.0 && std::abs(now.velocity_m_s.z()) < 0.1;
    if (!on_ground) ground_since_s_ = now.time_s;
    if (descending_ && now.time_s > ground_since_s_ + 0.5) {
      landed_ = true;
      flying_ = false;
    }
  }

  geometry::Vec3 wanted_thrust_n(const Observation& now, double step_s) {
    geometry::Vec3 velocity = 1.0 * (goal_ - now.position_m);
    const double level = velocity.head<2>().norm();
    if (level > 4.0) velocity.head<2>() *= 4.0 / level;
    velocity.z() = descending_ ? kDescent_m_s : std::clamp(velocity.z(), -1.5, 1.5);
    const geometry::Vec3 error = velocity - now.velocity_m_s;
    drift_ = (drift_ + 0.6 * step_s * error).cwiseMax(-3.0).cwiseMin(3.0);
    geometry::Vec3 acceleration = 2.5 * error + drift_;
    const double sideways = acceleration.head<2>().norm();
    if (sideways > 5.0) acceleration.head<2>() *= 5.0 / sideways;
    acceleration.z() = std::clamp(acceleration.z(), -4.0, 4.0);
    return airframe_.body.mass_kg * (acceleration - geometry::Vec3(0, 0, vehicle::kStandardGravity_m_s2));
  }

  geometry::Vec3 wanted_torque_nm(const Observation& now, const geometry::Vec3& thrust_n) const {
    geometry::Mat3 wanted;  // x north as far as the thrust's direction lets it
    wanted.col(2) = -thrust_n.normalized();
    wanted.col(1) = wanted.col(2).cross(geometry::Vec3::UnitX()).normalized();
    wanted.col(0) = wanted.col(1).cross(wanted.col(2));
    const geometry::Mat3 R = now.R_ned_body.toRotationMatrix();
    const geometry::Mat3 skew = 0.5 * (wanted.transpose() * R - R.transpose() * wanted);
    const geometry::Vec3 tilted(skew(2, 1), skew(0, 2), skew(1, 0));
    const geometry::Vec3 rate = -geometry::Vec3(8, 8, 3).cwiseProduct(tilted);
    const geometry::Vec3 gains(25, 25, 10);
    return airframe_.body.inertia_kg_m2 * gains.cwiseProduct(rate - now.gyro_rad_s);
  }

  std::vector<double> mix(double thrust_n, const geometry::Vec3& torque_nm) const {
    const Eigen::Vector4d demand(thrust_n, torque_nm.x(), torque_nm.y(), torque_nm.z());
    const Eigen::VectorXd thrusts_n = thrusts_from_demand_ * demand;
    const double most_n = airframe_.thrust_n_s2 * airframe_.max_rotor_speed_rad_s * airframe_.max_rotor_speed_rad_s;
    std::vector<double> outputs;
    for (const double one : thrusts_n) outputs.push_back(output_of(std::clamp(one / most_n, 0.0, 1.0)));
    return outputs;
  }

  /// Inverse of thrust_share().
  double output_of(double share) const {
    if (expo_ <= 0.0) return share;
    const double linear = 1.0 - expo_;
    return (std::sqrt(linear * linear + 4.0 * expo_ * share) - linear) / (2.0 * expo_);
  }

  vehicle::Airframe airframe_;
  std::vector<geometry::Vec3> points_;
  double expo_;
  Eigen::MatrixXd thrusts_from_demand_;
  geometry::Vec3 home_ = geometry::Vec3::Zero(), goal_ = geometry::Vec3::Zero(), drift_ = geometry::Vec3::Zero();
  std::size_t next_ = 0;
  bool flying_ = false, descending_ = false, landed_ = false;
  double descent_since_s_ = 0.0, ground_since_s_ = 0.0;
};

/// A square of this side at this height, north, east, south, west, that ends where it begins.
inline std::vector<geometry::Vec3> square(double side_m, double height_m) {
  return {{0, 0, -height_m},
          {side_m, 0, -height_m},
          {side_m, side_m, -height_m},
          {0, side_m, -height_m},
          {0, 0, -height_m}};
}

}  // namespace tileflight::autopilot::test_support
