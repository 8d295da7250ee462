#include "tileflight/slam/odometry/metric_odometry.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

#include "tileflight/core/geometry/transform.h"
#include "tileflight/slam/odometry/test_inertial_flight.h"

namespace tileflight::odometry::metric_odometry_test {
namespace {

using geometry::SE3;
using geometry::Vec3;
using test_support::fly;
using test_support::InertialFlight;
using test_support::kT_imu_camera;
using test_support::lively_camera;
using test_support::steady_camera;

MetricOdometryOptions options_for(const InertialFlight& flight) {
  MetricOdometryOptions options;
  options.odometry = test_support::small_options();
  options.odometry.initialization.buffer_mb = 0.0;
  options.odometry.tracking.max_failed_frames = 10;
  options.imu = flight.readings.model;
  return options;
}

/// Feeds a flight that begins at `begin_s`, until there are so many estimates.
std::vector<MetricResult> feed(const InertialFlight& flight, MetricOdometry& odometry, double begin_s = 0.0,
                               std::size_t most_estimates = SIZE_MAX) {
  std::vector<MetricResult> results;
  std::size_t next = 0, estimates = 0;
  const auto& readings = flight.readings.samples;
  for (std::size_t i = 0; i < flight.sequence.images.size() && estimates < most_estimates; ++i) {
    const double time_s = static_cast<double>(i) / test_support::kInertialFps;
    for (; next < readings.size() && readings[next].time_s <= time_s; ++next) {
      geometry::ImuSample reading = readings[next];
      reading.time_s += begin_s;
      odometry.add_reading(reading);
    }
    results.push_back(odometry.add(flight.sequence.images[i], begin_s + time_s));
    if (results.back().estimate) ++estimates;
  }
  return results;
}

const InertialFlight& lively_flight() {
  static const InertialFlight kFlight = fly(lively_camera, 210);
  return kFlight;
}

/// The right estimate: the unit's true motion in the frame of the first estimate's place and heading.
struct Truth {
  explicit Truth(double first_s) {
    const SE3 first = T_local_imu(first_s);
    const Vec3 forward = first.rotation * Vec3::UnitX();
    const Eigen::Quaterniond turn(Eigen::AngleAxisd(-std::atan2(forward.y(), forward.x()), Vec3::UnitZ()));
    T_world_local = SE3(turn, -(turn * first.translation));
  }
  static SE3 T_local_imu(double t) { return lively_camera(t) * kT_imu_camera.inverse(); }
  SE3 T_world_imu(double t) const { return T_world_local * T_local_imu(t); }
  Vec3 velocity_m_s(double t) const {
    constexpr double kStep_s = 1e-4;
    return (T_world_imu(t + kStep_s).translation - T_world_imu(t - kStep_s).translation) / (2.0 * kStep_s);
  }
  SE3 T_world_local;
};

TEST(MetricOdometryTest, PathVelocityAndVerticalAreTrueFromWhenTheScaleIsKnown) {
  const InertialFlight& flight = lively_flight();
  MetricOdometry odometry(flight.sequence.calibration, options_for(flight));
  const auto results = feed(flight, odometry);
  ASSERT_EQ(results.front().status, MetricStatus::kStarting);
  std::optional<Truth> truth;
  double position2 = 0.0, velocity2 = 0.0, normalized2 = 0.0, tilt_rad = 0.0;
  int count = 0;
  for (const MetricResult& result : results) {
    if (!result.estimate) continue;
    const MetricEstimate& now = *result.estimate;
    if (!truth) {
      truth.emplace(now.time_s);
      EXPECT_LT(now.T_world_imu.translation.norm(), 1e-9);
      continue;
    }
    const Vec3 error = now.T_world_imu.translation - truth->T_world_imu(now.time_s).translation;
    const Vec3 velocity_error = now.velocity_m_s - truth->velocity_m_s(now.time_s);
    position2 += error.squaredNorm();
    velocity2 += velocity_error.squaredNorm();
    normalized2 += velocity_error.dot(now.velocity_covariance_m2_s2.inverse() * velocity_error) / 3.0;
    const Vec3 up = now.T_world_imu.rotation.conjugate() * Vec3::UnitZ();
    const Vec3 true_up = truth->T_world_imu(now.time_s).rotation.conjugate() * Vec3::UnitZ();
    tilt_rad = std::max(tilt_rad, std::acos(std::min(1.0, up.dot(true_up))));
    EXPECT_LT(error.norm(), 3.0 * std::sqrt(now.position_covariance_m2.trace()) + 0.02) << now.time_s;
    ++count;
  }
  ASSERT_GT(count, 60);
  EXPECT_LT(std::sqrt(position2 / count), 0.1);
  EXPECT_LT(std::sqrt(velocity2 / count), 0.1);
  EXPECT_LT(std::sqrt(normalized2 / count), 2.0);
  EXPECT_LT(tilt_rad, 1.0 * geometry::kRadiansPerDegree);
  EXPECT_EQ(odometry.restarts(), 0);
}

// Black images from when it is metric until it is lost: no estimates, and then a new map, which goes on from the pose
// before. The flight is played again from its start for it, half a second later.
TEST(MetricOdometryTest, ALostMapIsFollowedByANewOneThatGoesOnFromItsPose) {
  const InertialFlight& flight = lively_flight();
  MetricOdometry odometry(flight.sequence.calibration, options_for(flight));
  const auto first = feed(flight, odometry, 0.0, 20);
  ASSERT_EQ(first.back().status, MetricStatus::kMetric);
  const Vec3 left = first.back().estimate->T_world_imu.translation;
  const double again_s = static_cast<double>(first.size()) / test_support::kInertialFps;
  for (int i = 0; i < 12; ++i) {
    const imaging::RgbImage black(320, 240, imaging::Rgb8{});
    const MetricResult result = odometry.add(black, again_s + i / test_support::kInertialFps);
    EXPECT_FALSE(result.estimate);
    EXPECT_EQ(result.status, i < 10   ? MetricStatus::kNotAligned
                             : i > 10 ? MetricStatus::kStarting
                                      : MetricStatus::kLost);
    EXPECT_THAT(result.reason, testing::Not(testing::IsEmpty()));
  }
  EXPECT_EQ(odometry.restarts(), 1);
  const auto second = feed(flight, odometry, again_s + 0.5, 1);
  const auto begun = std::ranges::find_if(second, [](const MetricResult& one) { return one.estimate.has_value(); });
  ASSERT_NE(begun, second.end());
  EXPECT_LT((begun->estimate->T_world_imu.translation - left).norm(), 1e-9);
  EXPECT_EQ(odometry.restarts(), 1);
}

TEST(MetricOdometryTest, AtConstantVelocityThereIsNoEstimate) {
  const InertialFlight flight = fly(steady_camera, 60);
  MetricOdometry odometry(flight.sequence.calibration, options_for(flight));
  for (const MetricResult& result : feed(flight, odometry)) {
    EXPECT_FALSE(result.estimate);
    EXPECT_THAT(result.reason, testing::Not(testing::IsEmpty()));
  }
}

}  // namespace
}  // namespace tileflight::odometry::metric_odometry_test
