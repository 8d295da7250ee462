#include "tileflight/odometry/inertial_flight.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tileflight/base/input_error.h"
#include "tileflight/geometry/angles.h"

namespace tileflight::odometry::inertial_flight_test {
namespace {

using geometry::SE3;
using geometry::Vec3;
using test_support::fly;
using test_support::InertialFlight;
using test_support::lively_camera;
using test_support::steady_camera;
using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

OdometryResult track(const InertialFlight& flight, bool with_readings) {
  Priors priors;
  if (with_readings) priors.inertial = flight.readings;
  return run_odometry(flight.sequence.calibration, nullptr, flight.sequence.source(), test_support::small_options(), {},
                      priors);
}

/// Whether two results are the same to the last digit.
void expect_same(const OdometryResult& a, const OdometryResult& b) {
  ASSERT_EQ(a.trajectory.size(), b.trajectory.size());
  for (std::size_t i = 0; i < a.trajectory.size(); ++i)
    EXPECT_EQ(a.trajectory.poses[i].T_local_camera.matrix(), b.trajectory.poses[i].T_local_camera.matrix());
  EXPECT_EQ(a.map.positions, b.map.positions);
}

TEST(InertialFlightTest, ARenderedFlightBecomesMetricAndLevel) {
  const InertialFlight flight = fly(lively_camera, 130);
  const OdometryResult result = track(flight, true);
  ASSERT_FALSE(result.lost) << result.lost_reason;
  ASSERT_TRUE(result.inertial && result.inertial->metric) << result.inertial->reason;
  const geometry::Sim3 T = test_support::similarity_to_truth(result.trajectory, flight.sequence.truth);
  EXPECT_NEAR(T.scale, 1.0, 0.01);
  EXPECT_LT(std::abs(std::log(T.scale)), 4.0 * result.inertial->sigma_log_scale + 0.002);
  // Level: only a heading is left between both frames.
  const double tilt_rad = std::acos((T.rotation * Vec3::UnitZ()).z());
  EXPECT_LT(tilt_rad, 4.0 * result.inertial->sigma_up_rad);
  EXPECT_LT(tilt_rad, 1.0 * geometry::kRadiansPerDegree);  // four seconds hardly tell it from the accelerometer's bias
  EXPECT_LT(test_support::relative_ate(result.trajectory, flight.sequence.truth), 0.005);
  // The map goes along: its points, moved but not scaled, lie on the ground.
  std::vector<double> errors;
  const geometry::Sim3 rigid(1.0, T.rotation, T.translation);
  const auto relief = test_support::hilly_ground();
  for (const Vec3& point : result.map.positions) {
    const Vec3 p = rigid * point;
    errors.push_back(std::abs(p.z() - relief.height_m(p.x(), p.y())));
  }
  ASSERT_GT(errors.size(), 500U);
  std::nth_element(errors.begin(), errors.begin() + static_cast<std::ptrdiff_t>(errors.size() / 2), errors.end());
  EXPECT_LT(errors[errors.size() / 2], 0.15);  // from 12 m above
}

// Tracking does not see the readings: but for frame and scale nothing changes.
TEST(InertialFlightTest, ReadingsDoNotChangeTracking) {
  const InertialFlight flight = fly(lively_camera, 60);
  const OdometryResult mono = track(flight, false), with = track(flight, true);
  EXPECT_FALSE(mono.inertial);
  ASSERT_TRUE(with.inertial);
  ASSERT_EQ(mono.quality.size(), with.quality.size());
  for (std::size_t i = 0; i < mono.quality.size(); ++i) EXPECT_EQ(mono.quality[i].rmse, with.quality[i].rmse);
  EXPECT_EQ(mono.keyframe_frame_indices, with.keyframe_frame_indices);
  EXPECT_EQ(mono.map.size(), with.map.size());
}

TEST(InertialFlightTest, AtConstantVelocityTheMapIsTheMonocularOne) {
  const InertialFlight flight = fly(steady_camera, 60);
  const OdometryResult mono = track(flight, false), with = track(flight, true);
  ASSERT_TRUE(with.inertial);
  EXPECT_FALSE(with.inertial->metric);
  EXPECT_THAT(with.inertial->reason, testing::Not(testing::IsEmpty()));
  expect_same(mono, with);
}

TEST(InertialFlightTest, PosesAndReadingsTogetherAreRefused) {
  Priors priors;
  priors.inertial.emplace();
  priors.poses.poses.push_back({0.0, SE3()});
  imaging::Calibration calibration;
  calibration.camera = imaging::make_fisheye(320, 240, 120.0);
  EXPECT_THAT([&] { Odometry(calibration, {}, {.photometric = {}, .priors = priors, .keyframe_observer = {}}); },
              ThrowsMessage<InputError>(HasSubstr("poses or depth and an inertial unit are both given")));
}

}  // namespace
}  // namespace tileflight::odometry::inertial_flight_test
