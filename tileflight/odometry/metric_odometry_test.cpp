#include "tileflight/odometry/metric_odometry.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "tileflight/geometry/angles.h"
#include "tileflight/odometry/inertial_flight.h"

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

/// Feeds a flight, with black images from `dark_from` to `dark_to`.
std::vector<MetricResult> feed(const InertialFlight& flight, MetricOdometry& odometry, std::size_t dark_from = 0,
                               std::size_t dark_to = 0) {
  std::vector<MetricResult> results;
  std::size_t next = 0;
  const auto& readings = flight.readings.samples;
  for (std::size_t i = 0; i < flight.sequence.images.size(); ++i) {
    const double time_s = static_cast<double>(i) / test_support::kInertialFps;
    for (; next < readings.size() && readings[next].time_s <= time_s; ++next) odometry.add_reading(readings[next]);
    imaging::RgbImage image = flight.sequence.images[i];
    if (i >= dark_from && i < dark_to) image = imaging::RgbImage(image.width, image.height, imaging::Rgb8{});
    results.push_back(odometry.add(std::move(image), time_s));
  }
  return results;
}

/// What an estimate should be: the unit's true motion, with the first estimate's place and heading as its frame.
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
  const InertialFlight flight = fly(lively_camera, 210);
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
  std::printf("count %d pos %.3f vel %.3f norm %.2f tilt %.2f deg sigma %.4f\n", count, std::sqrt(position2 / count),
              std::sqrt(velocity2 / count), std::sqrt(normalized2 / count), tilt_rad / geometry::kRadiansPerDegree,
              results.back().estimate->sigma_log_scale);
  EXPECT_LT(std::sqrt(position2 / count), 0.1);
  EXPECT_LT(std::sqrt(velocity2 / count), 0.1);
  EXPECT_LT(std::sqrt(normalized2 / count), 2.0);
  EXPECT_LT(tilt_rad, 1.0 * geometry::kRadiansPerDegree);
  EXPECT_EQ(odometry.restarts(), 0);
}

}  // namespace
}  // namespace tileflight::odometry::metric_odometry_test
