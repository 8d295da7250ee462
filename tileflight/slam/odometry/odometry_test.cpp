#include "tileflight/slam/odometry/odometry.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include "tileflight/core/base/input_error.h"
#include "tileflight/slam/keyframes/options.h"
#include "tileflight/slam/odometry/synthetic_flight.h"

namespace tileflight::odometry::odometry_test {
namespace {

using geometry::SE3;
using geometry::Vec3;
using keyframes::test_support::Relief;
using test_support::relative_ate;
using test_support::render_sequence;
using test_support::Sequence;
using test_support::small_options;
using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

/// Nearly flat ground seen obliquely from above through a wide lens: its mirror solution defeats two-view
/// initialization. The first `frames` of 50.
Sequence over_flat_ground(std::size_t frames) {
  static const Sequence kAll = [] {
    const Relief relief = keyframes::test_support::sine_hills({.amplitude_m = 0.6, .k_x = 0.3, .k_y = 0.2}, 0.8);
    std::vector<SE3> truth;
    for (int i = 0; i < 50; ++i) {
      const double s = i / 30.0;
      truth.push_back(keyframes::test_support::look_along(Vec3(4.0 * s, 5.0 * s, 20.0 + 0.5 * std::sin(s)),
                                                          Vec3(0.3 * std::sin(0.7 * s), 1.0, -1.0)));
    }
    return render_sequence(imaging::make_fisheye(320, 200, 130.0), relief, truth);
  }();
  Sequence part = kAll;
  part.images.resize(frames);
  part.truth.resize(frames);
  return part;
}

TEST(Odometry, FollowsAFlightOverNearlyFlatGround) {
  const Sequence sequence = over_flat_ground(50);
  const OdometryResult result = run_odometry(sequence.calibration, sequence.source(), small_options());
  EXPECT_FALSE(result.lost) << result.lost_reason;
  EXPECT_EQ(result.frames_tracked, 50);
  EXPECT_LT(relative_ate(result.trajectory, sequence.truth), 0.005);
  EXPECT_GT(result.map.size(), 300U);
  for (const char* name : {"inverse_depth_variance", "observations", "first_frame", "last_frame"}) {
    EXPECT_EQ(result.map.scalars.at(name).size(), result.map.size());
  }
}

TEST(Odometry, FollowsForwardFlightThroughHills) {
  Relief relief;
  relief.height_m = [](double x, double y) {
    return 4.0 * keyframes::test_support::sine(0.2 * x + 1.0) * keyframes::test_support::cosine(0.13 * y) +
           0.02 * x * x;
  };
  relief.highest_m = 60.0;
  relief.texel_m = 0.5;
  std::vector<SE3> truth;
  for (int i = 0; i < 50; ++i)
    truth.push_back(
        keyframes::test_support::look_along(Vec3(0.2 * std::sin(0.1 * i), 0.25 * i, 8.0), Vec3(0, 1, -0.25)));
  const Sequence sequence = render_sequence(imaging::make_pinhole(320, 220, 80.0), relief, truth);
  const OdometryResult result = run_odometry(sequence.calibration, sequence.source(), small_options());
  EXPECT_FALSE(result.lost) << result.lost_reason;
  EXPECT_GE(result.frames_tracked, 38);
  EXPECT_LT(relative_ate(result.trajectory, sequence.truth), 0.01);
}

TEST(Odometry, IsTheSameForAnyNumberOfThreads) {
  const Sequence sequence = over_flat_ground(30);
  const auto run = [&](int threads) {
    const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
    return run_odometry(sequence.calibration, sequence.source(), small_options());
  };
  const OdometryResult one = run(1), two = run(2);
  ASSERT_EQ(one.trajectory.size(), two.trajectory.size());
  ASSERT_GT(one.trajectory.size(), 20U);
  for (std::size_t i = 0; i < one.trajectory.size(); ++i) {
    EXPECT_TRUE(one.trajectory.poses[i].T_local_camera.matrix() == two.trajectory.poses[i].T_local_camera.matrix());
  }
  EXPECT_TRUE(one.map.positions == two.map.positions);
}

TEST(Odometry, SaysThatThereIsNoParallax) {
  Relief relief;
  std::vector<SE3> truth;
  for (int i = 0; i < 12; ++i)
    truth.push_back(keyframes::test_support::look_along(Vec3(0, 0, 20), Vec3(0.02 * i, 1.0, -1.0)));
  const Sequence sequence = render_sequence(imaging::make_fisheye(240, 160, 120.0), relief, truth);
  const OdometryResult result = run_odometry(sequence.calibration, sequence.source(), small_options());
  EXPECT_TRUE(result.lost);
  EXPECT_EQ(result.frames_tracked, 0);
  EXPECT_TRUE(result.map.empty());
  EXPECT_NE(result.lost_reason.find("no parallax"), std::string::npos) << result.lost_reason;
}

TEST(Odometry, BlackPicturesInTheMiddleLoseItOnlyForAWhile) {
  Sequence sequence = over_flat_ground(50);
  for (const int i : {35, 36})
    std::fill(sequence.images[i].pixels.begin(), sequence.images[i].pixels.end(), imaging::Rgb8{});
  const OdometryResult result = run_odometry(sequence.calibration, sequence.source(), small_options());
  EXPECT_FALSE(result.lost) << result.lost_reason;
  EXPECT_EQ(result.frames_tracked, 48);
  EXPECT_LT(relative_ate(result.trajectory, sequence.truth), 0.01);
}

TEST(Odometry, SaysWhereItWasLost) {
  Sequence sequence = over_flat_ground(35);
  for (std::size_t i = 25; i < 35; ++i)
    std::fill(sequence.images[i].pixels.begin(), sequence.images[i].pixels.end(), imaging::Rgb8{});
  keyframes::OdometryOptions options = small_options();
  options.tracking.max_failed_frames = 4;
  const OdometryResult result = run_odometry(sequence.calibration, sequence.source(), options);
  EXPECT_TRUE(result.lost);
  EXPECT_EQ(result.frames_tracked, 25);
  EXPECT_NE(result.lost_reason.find("frame 29"), std::string::npos) << result.lost_reason;
  EXPECT_FALSE(result.map.empty());
}

TEST(Odometry, AFlightThatEndsInAWallIsLost) {
  Sequence sequence = over_flat_ground(40);
  for (std::size_t i = 32; i < 40; ++i)
    std::fill(sequence.images[i].pixels.begin(), sequence.images[i].pixels.end(), imaging::Rgb8{90, 90, 90});
  const OdometryResult result = run_odometry(sequence.calibration, sequence.source(), small_options());
  EXPECT_TRUE(result.lost);
  EXPECT_EQ(result.frames_tracked, 32);
  EXPECT_NE(result.lost_reason.find("frame 39"), std::string::npos) << result.lost_reason;
}

TEST(Odometry, EachPictureHasAQuality) {
  Sequence sequence = over_flat_ground(40);
  for (const int i : {35, 36})
    std::fill(sequence.images[i].pixels.begin(), sequence.images[i].pixels.end(), imaging::Rgb8{});
  const OdometryResult result = run_odometry(sequence.calibration, sequence.source(), small_options());
  ASSERT_EQ(result.quality.size(), 40U);
  std::size_t keyframes = 0, tracked = 0;
  double sigma_log_scale = 0.0;
  for (std::size_t i = 0; i < 40; ++i) {
    const tracking::FrameQuality& q = result.quality[i];
    EXPECT_EQ(q.frame, static_cast<std::int64_t>(i));
    EXPECT_EQ(q.tracked, i != 35 && i != 36);
    if (!q.tracked) continue;
    keyframes += q.is_keyframe;
    EXPECT_GE(q.sigma_log_scale, sigma_log_scale);  // it only grows
    sigma_log_scale = q.sigma_log_scale;
    // distance_to_keyframe is the distance between the camera and its keyframe in the trajectory.
    const Vec3 position = result.trajectory.poses[tracked++].T_local_camera.translation;
    if (q.keyframe < 0) continue;
    const Vec3 before = result.keyframes.poses[q.keyframe].T_local_camera.translation;
    EXPECT_NEAR(q.distance_to_keyframe, (position - before).norm(), 1e-6);
    EXPECT_GT(q.sigma_position, 0.0);
    EXPECT_LT(q.sigma_position, 0.1 * q.distance_to_keyframe + 0.01);
    EXPECT_GT(q.known_points, 50);
  }
  EXPECT_EQ(keyframes, result.keyframes.size());
  EXPECT_GT(sigma_log_scale, 0.0);
}

TEST(Odometry, RefusesAPictureOfAnotherSize) {
  Sequence sequence;
  sequence.calibration.camera = imaging::make_pinhole(320, 240, 80.0);
  sequence.images.emplace_back(200, 100);
  EXPECT_THAT([&] { run_odometry(sequence.calibration, sequence.source(), {}); },
              ThrowsMessage<InputError>(HasSubstr("is 200x100, the calibration is for 320x240")));
}

TEST(Odometry, NoPicturesIsLostWithAReason) {
  Sequence sequence;
  sequence.calibration.camera = imaging::make_pinhole(320, 240, 80.0);
  const OdometryResult result = run_odometry(sequence.calibration, sequence.source(), {});
  EXPECT_TRUE(result.lost);
  EXPECT_EQ(result.lost_reason, "no images");
}

}  // namespace
}  // namespace tileflight::odometry::odometry_test
