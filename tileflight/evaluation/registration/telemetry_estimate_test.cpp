#include "tileflight/evaluation/registration/telemetry_estimate.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <random>

#include "tileflight/evaluation/registration/test_flights.h"

namespace tileflight::registration::telemetry_estimate_test {
namespace {

using namespace test_flights;

std::vector<alignment::PositionFix> receiver(const geometry::Trajectory& local, const Vec3& bias, double noise_m) {
  std::mt19937_64 random(3);
  std::normal_distribution<double> normal;
  std::vector<alignment::PositionFix> fixes;
  for (const auto& pose : local.poses)
    fixes.push_back(
        {pose.time_s,
         pose.T_local_camera.translation + bias + noise_m * Vec3(normal(random), normal(random), normal(random)), 1.0,
         2.0});
  return fixes;
}

std::vector<AttitudeFix> gimbal(const geometry::Trajectory& local, const Vec3& bias_rad) {
  std::vector<AttitudeFix> fixes;
  for (const auto& pose : local.poses)
    fixes.push_back({pose.time_s, geometry::so3_exp(bias_rad) * pose.T_local_camera.rotation, 0.02, 0.1});
  return fixes;
}

double angle(const Eigen::Quaterniond& a, const Eigen::Quaterniond& b) { return a.angularDistance(b); }

TEST(TelemetryEstimate, AttitudeTurnsTheMapAndOutliersDoNotCount) {
  const Flight flight = simulate_map(straight_path(), 1);
  std::vector<AttitudeFix> fixes = gimbal(flight.local, Vec3(0.0, 0.0, 0.03));
  for (const std::size_t k : {1U, 5U, 9U}) fixes[k].R_local_camera = Eigen::Quaterniond::Identity();
  const auto rotation = rotation_from_attitudes(flight.map, fixes);
  ASSERT_TRUE(rotation);
  EXPECT_EQ(rotation->fixes, 20U);
  EXPECT_NEAR(angle(rotation->R_local_map, T_local_map().rotation), 0.03, 0.003);
  EXPECT_FALSE(rotation_from_attitudes(flight.map, {{1e6, Eigen::Quaterniond::Identity()}}));
}

TEST(TelemetryEstimate, AStraightPathLeavesItsRollOpenAndSaysAboutWhichAxis) {
  const Flight flight = simulate_map(straight_path(), 1);
  const auto fixes = receiver(flight.local, Vec3::Zero(), 0.1);
  const alignment::TrajectoryAlignment fit =
      alignment::align_trajectory(flight.map, fixes, {.estimate_time_offset = false});
  const TelemetryEstimate telemetry = estimate_from_telemetry(flight.map, fixes, fit, std::nullopt);
  EXPECT_GT(telemetry.worst_rotation_sigma_rad, 0.5);
  const Vec3 along =
      (flight.local.poses.back().T_local_camera.translation - flight.local.poses.front().T_local_camera.translation)
          .normalized();
  EXPECT_GT(std::abs(telemetry.worst_axis_local.dot(along)), 0.99);
}

TEST(TelemetryEstimate, AttitudeClosesTheRollAndPositionsTheHeading) {
  const Flight flight = simulate_map(straight_path(), 1);
  const auto fixes = receiver(flight.local, Vec3(0.5, -0.4, 1.0), 0.05);
  const alignment::TrajectoryAlignment fit =
      alignment::align_trajectory(flight.map, fixes, {.estimate_time_offset = false});
  // The compass is off by six degrees; the path's own direction is better.
  const auto rotation = rotation_from_attitudes(flight.map, gimbal(flight.local, Vec3(0.01, 0.0, 0.1)));
  const TelemetryEstimate telemetry = estimate_from_telemetry(flight.map, fixes, fit, rotation);
  EXPECT_LT(telemetry.worst_rotation_sigma_rad, 0.05);
  EXPECT_LT(angle(telemetry.estimate.T_target_source.rotation, T_local_map().rotation), 0.03);
  EXPECT_NEAR(telemetry.estimate.T_target_source.scale / T_local_map().scale, 1.0, 0.01);
}

TEST(TelemetryEstimate, ABiasIsNotAveragedAway) {
  const Flight flight = simulate_map(curved_path(), 1);
  const auto fixes = receiver(flight.local, Vec3::Zero(), 0.01);
  const alignment::TrajectoryAlignment fit =
      alignment::align_trajectory(flight.map, fixes, {.estimate_time_offset = false});
  const SimilarityEstimate estimate = estimate_from_telemetry(flight.map, fixes, fit, std::nullopt).estimate;
  EXPECT_NEAR(1.0 / std::sqrt(estimate.information(0, 0)), 1.0, 0.1);  // as stated by the fixes
  EXPECT_NEAR(1.0 / std::sqrt(estimate.information(2, 2)), 2.0, 0.2);
  EXPECT_LT(1.0 / std::sqrt(estimate.information(6, 6)), 0.01);  // the bias does not affect the scale
}

TEST(DistanceToFixes, IsTheMedianWithTheNearerOfTwoClocks) {
  geometry::Trajectory path;
  std::vector<alignment::PositionFix> fixes;
  for (int k = 0; k < 40; ++k) {
    path.poses.push_back({0.5 * k, {Eigen::Quaterniond::Identity(), Vec3(2.0 * k, 0, 0)}});  // 4 m/s
    fixes.push_back({0.5 * k, Vec3(2.0 * k, 1.5, k == 7 ? 900.0 : -0.5)});
  }
  const geometry::Sim3 there{1.0, Eigen::Quaterniond::Identity(), Vec3(0, 0, 0)};
  EXPECT_LT((distance_to_fixes(path, fixes, there, 0.9) - Vec3(0, -1.5, 0.5)).norm(), 1e-9) << "the clock as stated";
  for (auto& fix : fixes) fix.time_s -= 1.0;
  EXPECT_LT((distance_to_fixes(path, fixes, there, 1.0) - Vec3(0, -1.5, 0.5)).norm(), 1e-9) << "the clock as fitted";
  EXPECT_LT((distance_to_fixes(path, fixes, there, 1000.0) - Vec3(-4, -1.5, 0.5)).norm(), 1e-9) << "no such times";
  EXPECT_EQ(distance_to_fixes({}, fixes, there, 0.0), Vec3::Zero());
}

TEST(TelemetryEstimate, UpLeavesTheHeadingOpen) {
  const RotationEstimate rotation = upright_rotation({T_local_map().rotation.conjugate() * Vec3::UnitZ(), 0.02});
  const Eigen::Quaterniond rest = T_local_map().rotation * rotation.R_local_map.conjugate();
  EXPECT_LT((rest * Vec3::UnitZ() - Vec3::UnitZ()).norm(), 1e-12);
  EXPECT_GT(rotation.covariance(2, 2), std::numbers::pi);
  EXPECT_NEAR(rotation.covariance(0, 0), 4e-4, 1e-9);
}

TEST(TelemetryEstimate, GravityAndPositionsOfAStraightPathTellTheWholeTurn) {
  for (const unsigned seed : {1U, 2U, 3U}) {
    const Flight flight = simulate_map(straight_path(), 1, 0.0, seed);
    const auto fixes = receiver(flight.local, Vec3::Zero(), 0.01);
    const alignment::TrajectoryAlignment fit =
        alignment::align_trajectory(flight.map, fixes, {.estimate_time_offset = false});
    const UpDirection up{T_local_map().rotation.conjugate() * Vec3::UnitZ(), 0.02};
    const TelemetryEstimate telemetry = estimate_from_telemetry(flight.map, fixes, fit, upright_rotation(up));
    EXPECT_LT(telemetry.estimate.T_target_source.rotation.angularDistance(T_local_map().rotation), 0.03) << seed;
    EXPECT_LT(telemetry.worst_rotation_sigma_rad, 0.1) << seed;
  }
}

}  // namespace
}  // namespace tileflight::registration::telemetry_estimate_test

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
