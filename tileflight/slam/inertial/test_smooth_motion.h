#pragma once

// For the tests of this room: a motion given by formulas, and what an inertial unit reads along it.

#include <cmath>
#include <functional>
#include <random>
#include <vector>

#include "tileflight/slam/inertial/factors.h"

namespace tileflight::inertial::test_support {

using geometry::SE3;
using geometry::Vec3;

constexpr double kGravity_m_s2 = 9.80665;

/// Motion of the unit. Derivatives are by central differences, to about 1e-9.
struct SmoothMotion {
  std::function<Vec3(double)> position_m;
  std::function<Eigen::Quaterniond(double)> rotation;  ///< R_world_imu

  SE3 pose(double t) const { return {rotation(t), position_m(t)}; }
  Vec3 velocity(double t) const {
    constexpr double h = 1e-4;
    return (8.0 * (position_m(t + h) - position_m(t - h)) - (position_m(t + 2 * h) - position_m(t - 2 * h))) / (12 * h);
  }
  Vec3 acceleration(double t) const {
    constexpr double h = 1e-3;
    return (16.0 * (position_m(t + h) + position_m(t - h)) - (position_m(t + 2 * h) + position_m(t - 2 * h)) -
            30.0 * position_m(t)) /
           (12 * h * h);
  }
  Vec3 angular_rate(double t) const {  // in the unit's axes
    constexpr double h = 1e-4;
    return geometry::so3_log(rotation(t - h).conjugate() * rotation(t + h)) / (2 * h);
  }
  ImuState state(double t, const geometry::ImuBias& bias = {}) const { return {pose(t), velocity(t), bias}; }
  geometry::ImuSample reading(double t, const geometry::ImuBias& bias = {}) const {
    return {t, angular_rate(t) + bias.gyroscope_rad_s,
            rotation(t).conjugate() * (acceleration(t) + kGravity_m_s2 * Vec3::UnitZ()) + bias.accelerometer_m_s2};
  }
  std::vector<geometry::ImuSample> readings(double from_s, double to_s, double rate_hz,
                                            const geometry::ImuBias& bias = {}) const {
    std::vector<geometry::ImuSample> samples;
    const auto count = std::lround((to_s - from_s) * rate_hz);
    for (long i = 0; i <= count; ++i) samples.push_back(reading(from_s + static_cast<double>(i) / rate_hz, bias));
    return samples;
  }
};

/// A vehicle that swings, turns and climbs.
inline SmoothMotion lively_motion() {
  return {[](double t) {
            return Vec3(6.0 * std::sin(0.5 * t), 4.0 * std::cos(0.4 * t + 0.3), 10.0 + 1.5 * std::sin(0.7 * t));
          },
          [](double t) {
            return Eigen::Quaterniond(Eigen::AngleAxisd(0.8 * std::sin(0.3 * t) + 0.2 * t, Vec3::UnitZ()) *
                                      Eigen::AngleAxisd(0.3 * std::sin(0.9 * t), Vec3::UnitY()) *
                                      Eigen::AngleAxisd(0.2 * std::cos(0.7 * t), Vec3::UnitX()));
          }};
}

/// Straight ahead at constant velocity, without turning: scale and accelerometer's bias cannot be told apart.
inline SmoothMotion steady_motion() {
  return {[](double t) { return Vec3(4.0 * t, 0.5 * t, 20.0); },
          [](double) { return Eigen::Quaterniond(Eigen::AngleAxisd(0.4, Vec3(1, 2, 3).normalized())); }};
}

/// Adds white noise of the stated densities, and biases that wander.
inline void add_noise(const ImuNoise& noise, double rate_hz, unsigned seed, std::vector<geometry::ImuSample>& samples) {
  std::mt19937 random(seed);
  std::normal_distribution<double> normal;
  const auto vector = [&] { return Vec3(normal(random), normal(random), normal(random)); };
  const double root = std::sqrt(rate_hz);
  Vec3 gyroscope = Vec3::Zero(), accelerometer = Vec3::Zero();
  for (geometry::ImuSample& sample : samples) {
    sample.angular_rate_rad_s += gyroscope + noise.gyroscope_noise_density * root * vector();
    sample.specific_force_m_s2 += accelerometer + noise.accelerometer_noise_density * root * vector();
    gyroscope += noise.gyroscope_random_walk / root * vector();
    accelerometer += noise.accelerometer_random_walk / root * vector();
  }
}

}  // namespace tileflight::inertial::test_support
