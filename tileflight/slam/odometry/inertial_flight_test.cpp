#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <algorithm>

#include "tileflight/core/base/input_error.h"
#include "tileflight/core/geometry/transform.h"
#include "tileflight/slam/odometry/test_inertial_flight.h"

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

/// Without readings the intrinsics are held as well, as they are with them.
OdometryResult track(const InertialFlight& flight, bool with_readings, bool in_window = false) {
  OdometryInput input = flight.sequence.calibration;
  if (with_readings) input.inertial = flight.readings;
  OdometryOptions options = test_support::small_options();
  options.inertial_in_window = in_window;
  if (!with_readings) options.window.refine_intrinsics = false;
  return run_odometry(input, flight.sequence.source(), options);
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

// Outside of the window, readings help where images alone do not align: but for frame and scale nothing changes.
TEST(InertialFlightTest, ReadingsDoNotChangeTrackingThatWorks) {
  const InertialFlight flight = fly(lively_camera, 60);
  const OdometryResult mono = track(flight, false), with = track(flight, true);
  EXPECT_FALSE(mono.inertial);
  ASSERT_TRUE(with.inertial);
  ASSERT_FALSE(with.coupled_since_s);
  ASSERT_EQ(mono.quality.size(), with.quality.size());
  for (std::size_t i = 0; i < mono.quality.size(); ++i) EXPECT_EQ(mono.quality[i].rmse, with.quality[i].rmse);
  EXPECT_EQ(mono.keyframe_frame_indices, with.keyframe_frame_indices);
  EXPECT_EQ(mono.map.size(), with.map.size());
}

TEST(InertialFlightTest, ReadingsAreInTheWindowFromWhenOnTheScaleIsKnown) {
  const InertialFlight flight = fly(lively_camera, 130);
  const OdometryResult mono = track(flight, false), with = track(flight, true, true);
  EXPECT_FALSE(track(flight, true).coupled_since_s);
  ASSERT_TRUE(with.coupled_since_s);
  EXPECT_LT(*with.coupled_since_s, 3.5);
  ASSERT_EQ(with.frames_tracked, mono.frames_tracked);
  EXPECT_LT(test_support::relative_ate(with.trajectory, flight.sequence.truth),
            1.5 * test_support::relative_ate(mono.trajectory, flight.sequence.truth));
}

TEST(InertialFlightTest, TheResultDoesNotDependOnTheNumberOfThreads) {
  const InertialFlight flight = fly(lively_camera, 120);
  const auto track_with = [&](int threads) {
    const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
    return track(flight, true, true);
  };
  const OdometryResult one = track_with(1), four = track_with(4);
  ASSERT_TRUE(one.coupled_since_s);
  EXPECT_EQ(one.coupled_since_s, four.coupled_since_s);
  expect_same(one, four);
}

/// Looks ahead and down, and turns about the vertical by `turn_rad` between `from` and `to` (seconds).
std::function<SE3(double)> turning_camera(double turn_rad, double from, double to) {
  return [=](double t) {
    const double s = std::clamp((t - from) / (to - from), 0.0, 1.0), share = s * s * s * (s * (6.0 * s - 15.0) + 10.0);
    const SE3 T = lively_camera(t);
    return SE3(Eigen::Quaterniond(Eigen::AngleAxisd(turn_rad * share, Vec3::UnitZ())) * T.rotation, T.translation);
  };
}

// Images that show nothing while the camera turns by 35 degrees: afterwards it sees something of what it saw before,
// but from a direction that no image led to. Without readings, matched features tell where it looks.
TEST(InertialFlightTest, ATurnBehindBlindImagesIsSurvived) {
  InertialFlight flight = fly(turning_camera(0.9, 3.0, 3.3), 130);
  for (int i = 89; i < 101; ++i)
    std::ranges::fill(flight.sequence.images[static_cast<std::size_t>(i)].pixels,
                      std::array<std::uint8_t, 3>{90, 90, 90});
  const OdometryResult mono = track(flight, false), with = track(flight, true);
  for (const OdometryResult* result : {&mono, &with}) {
    EXPECT_GE(result->frames_tracked, 130 - 12);
    EXPECT_FALSE(result->lost) << result->lost_reason;
    EXPECT_LT(test_support::relative_ate(result->trajectory, flight.sequence.truth), 0.01);
  }
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
  OdometryInput input{imaging::Calibration()};
  input.calibration.camera = imaging::make_fisheye(320, 240, 120.0);
  input.inertial.emplace();
  input.poses.poses.push_back({0.0, SE3()});
  EXPECT_THAT([&] { Odometry odometry(input); },
              ThrowsMessage<InputError>(HasSubstr("poses or depth and an inertial unit are both given")));
}

}  // namespace
}  // namespace tileflight::odometry::inertial_flight_test
