#include "tileflight/evaluation/registration/inertial_up.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <random>

namespace tileflight::registration::inertial_up_test {
namespace {

using geometry::SE3;
using geometry::Vec3;

const Eigen::Quaterniond kMapLocal(Eigen::AngleAxisd(1.1, Vec3(0.3, -0.8, 0.5).normalized()));
constexpr double kScale = 0.04;  // map units per metre

struct Flight {
  geometry::Trajectory path;
  std::vector<SpecificForce> readings;
};

/// A rotating camera along a path with known acceleration; 10 poses and 100 readings per second.
Flight flight(double swing_m, double noise_m_s2, const Vec3& gravity = Vec3(0, 0, 9.81)) {
  const auto position = [&](double t) {
    return Vec3(4.0 * t, swing_m * std::sin(1.3 * t), 20.0 + 0.5 * swing_m * std::cos(0.9 * t));
  };
  const auto acceleration = [&](double t) {
    return Vec3(0, -1.69 * swing_m * std::sin(1.3 * t), -0.405 * swing_m * std::cos(0.9 * t));
  };
  const auto rotation = [](double t) {
    return Eigen::Quaterniond(Eigen::AngleAxisd(2.6 + 0.1 * std::sin(t), Vec3::UnitX()) *
                              Eigen::AngleAxisd(0.3 * t, Vec3::UnitZ()));
  };
  std::mt19937 random(3);
  std::normal_distribution<double> normal(0.0, noise_m_s2);
  Flight result;
  for (int i = 0; i <= 60; ++i) {
    const double t = 0.1 * i;
    result.path.poses.push_back({t, SE3{kMapLocal * rotation(t), kScale * (kMapLocal * position(t)) + Vec3(7, 8, 9)}});
  }
  for (int i = 0; i <= 600; ++i) {
    const double t = 0.01 * i;
    const Vec3 noise(normal(random), normal(random), normal(random));
    result.readings.push_back({t, rotation(t).conjugate() * (acceleration(t) + gravity) + noise});
  }
  return result;
}

double angle_off(const UpDirection& up) {
  return std::acos(std::clamp(up.up_map.dot(kMapLocal * Vec3::UnitZ()), -1.0, 1.0));
}

TEST(InertialUp, IsFoundWithoutTheScale) {
  for (const double swing_m : {0.0, 0.5, 4.0}) {
    const Flight f = flight(swing_m, 0.5);
    const auto up = estimate_up_from_accelerometer(f.path, f.readings);
    ASSERT_TRUE(up) << swing_m;
    EXPECT_LT(angle_off(*up), 0.02) << swing_m;
    EXPECT_LT(angle_off(*up), 3.0 * up->sigma_rad) << swing_m;
    EXPECT_LT(up->sigma_rad, 0.05) << swing_m;
  }
}

TEST(InertialUp, ASteadyClimbOfSpeedIsNotTakenForGravity) {
  // Braking at 2 m/s^2 tilts the mean force by 11 degrees; only intervals with different braking separate the two.
  Flight f = flight(4.0, 0.0);
  const auto up = estimate_up_from_accelerometer(f.path, f.readings);
  ASSERT_TRUE(up);
  Vec3 mean = Vec3::Zero();
  for (const SpecificForce& reading : f.readings)
    mean += geometry::interpolate(f.path, reading.time_s)->rotation * reading.force_m_s2;
  const double of_mean = std::acos(mean.normalized().dot(kMapLocal * Vec3::UnitZ()));
  EXPECT_LT(angle_off(*up), 0.3 * of_mean);
}

TEST(InertialUp, OtherUnitsOtherClocksAndTooFewReadingsAreNoGravity) {
  Flight in_g = flight(1.0, 0.0);
  for (SpecificForce& reading : in_g.readings) reading.force_m_s2 /= 9.81;
  EXPECT_FALSE(estimate_up_from_accelerometer(in_g.path, in_g.readings));
  Flight late = flight(1.0, 0.0);
  for (SpecificForce& reading : late.readings) reading.time_s += 100.0;
  EXPECT_FALSE(estimate_up_from_accelerometer(late.path, late.readings));
  Flight few = flight(1.0, 0.0);
  few.readings.resize(20);
  EXPECT_FALSE(estimate_up_from_accelerometer(few.path, few.readings));
  EXPECT_FALSE(estimate_up_from_accelerometer({}, few.readings));
}

}  // namespace
}  // namespace tileflight::registration::inertial_up_test
