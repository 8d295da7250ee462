// Images before the first keyframe: their poses against the truth, against the flight played in reverse, and the images
// after them against a run that never saw them.

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <algorithm>

#include "tileflight/slam/odometry/odometry.h"
#include "tileflight/slam/odometry/synthetic_flight.h"

namespace tileflight::odometry::backward_tracking_test {
namespace {

using geometry::SE3;
using geometry::Vec3;
using keyframes::test_support::look_along;
using keyframes::test_support::Relief;
using test_support::relative_ate;
using test_support::render_sequence;
using test_support::Sequence;
using test_support::small_options;

constexpr int kTurning = 24;  ///< pictures that turn

Relief hills() {
  return keyframes::test_support::sine_hills({.amplitude_m = 3.0, .k_x = 0.2, .k_y = 0.17, .phase_x = 1.0}, 0.5);
}

/// A flight that begins with a slow turn and then goes on straight, five times as fast.
std::vector<SE3> path_that_begins_with_a_turn(int frames) {
  std::vector<SE3> path;
  Vec3 position(0, 0, 14.0);
  for (int i = 0; i < frames; ++i) {
    const double heading = i < kTurning ? 0.11 * (i - kTurning) : 0.0;
    path.push_back(look_along(position, Vec3(std::sin(heading), std::cos(heading), -0.8)));
    position += (i < kTurning ? 0.08 : 0.4) * Vec3(std::sin(heading), std::cos(heading), 0.0);
  }
  return path;
}

const Sequence& turning_flight() {
  static const Sequence kFlight =
      render_sequence(imaging::make_pinhole(320, 220, 80.0), hills(), path_that_begins_with_a_turn(60));
  return kFlight;
}

/// Options with which the turn defeats the start: the parallax wanted takes longer than a corner stays in view.
OdometryOptions patient_options() {
  OdometryOptions options = small_options();
  options.initialization.min_parallax_rad = options.initialization.fallback_parallax_rad = 0.06;
  return options;
}

/// Number of images added until there is a map; the flight's length if there is none.
std::size_t images_to_start(const Sequence& flight, const OdometryOptions& options) {
  Odometry odometry(flight.calibration, options);
  for (std::size_t i = 0; i < flight.images.size(); ++i) {
    if (odometry.add(flight.images[i], static_cast<double>(i) / 30.0).status == FrameStatus::kTracked) return i + 1;
  }
  return flight.images.size();
}

Sequence reversed(Sequence flight) {
  std::reverse(flight.images.begin(), flight.images.end());
  std::reverse(flight.truth.begin(), flight.truth.end());
  return flight;
}

/// The trajectory's part before `until_s`.
geometry::Trajectory part_before(geometry::Trajectory trajectory, double until_s) {
  std::erase_if(trajectory.poses, [&](const geometry::StampedPose& pose) { return pose.time_s >= until_s; });
  return trajectory;
}

OdometryResult run(const Sequence& flight, const OdometryOptions& options = patient_options()) {
  return run_odometry(flight.calibration, flight.source(), options);
}

TEST(BackwardTracking, AFlightThatBeginsWithATurnIsWhole) {
  const Sequence& flight = turning_flight();
  const OdometryResult result = run(flight);
  EXPECT_FALSE(result.lost) << result.lost_reason;
  EXPECT_EQ(result.frames_tracked, 60);
  EXPECT_GT(result.frames_tracked_backwards, 10);  // the turn defeats the start, which this test is about
  EXPECT_LT(relative_ate(result.trajectory, flight.truth), 0.01);
  // The pictures before the start alone, against the truth: the map was extended over a turn of more than the field of
  // view.
  const double start_s = static_cast<double>(result.frames_tracked_backwards) / 30.0;
  ASSERT_GT(part_before(result.trajectory, start_s).size(), 3U);
  EXPECT_LT(relative_ate(part_before(result.trajectory, start_s), flight.truth), 0.03);
}

TEST(BackwardTracking, IsAsAccurateAsTheFlightPlayedInReverse) {
  const Sequence& flight = turning_flight();
  const OdometryResult forwards = run(flight), backwards = run(reversed(flight));
  ASSERT_EQ(backwards.frames_tracked, 60);
  EXPECT_LT(relative_ate(forwards.trajectory, flight.truth),
            2.0 * relative_ate(backwards.trajectory, reversed(flight).truth) + 0.002);
}

TEST(BackwardTracking, LaterImagesAreTheSameToTheLastBit) {
  const Sequence& flight = turning_flight();
  OdometryOptions forgetful = patient_options();
  forgetful.initialization.buffer_mb = 0.0;
  const OdometryResult whole = run(flight), part = run(flight, forgetful);
  EXPECT_EQ(part.frames_tracked_backwards, 0);
  ASSERT_EQ(whole.frames_tracked - whole.frames_tracked_backwards, part.frames_tracked);
  const auto earlier = static_cast<std::size_t>(whole.frames_tracked_backwards);
  for (std::size_t i = 0; i < part.trajectory.size(); ++i) {
    EXPECT_TRUE(whole.trajectory.poses[earlier + i].T_local_camera.matrix() ==
                part.trajectory.poses[i].T_local_camera.matrix());
  }
  const std::size_t added = whole.keyframes.size() - part.keyframes.size();
  EXPECT_GT(added, 2U);  // the first map does not reach so far
  for (std::size_t i = 0; i < part.quality.size(); ++i) {
    const FrameQuality &a = whole.quality[i], &b = part.quality[i];
    if (!b.tracked) continue;
    EXPECT_EQ(a.keyframe, b.keyframe < 0 ? -1 : b.keyframe + static_cast<int>(added));
    EXPECT_EQ(a.sigma_position, b.sigma_position);
    EXPECT_EQ(a.sigma_log_scale, b.sigma_log_scale);
  }
  ASSERT_GE(whole.map.size(), part.map.size());
  EXPECT_TRUE(std::equal(part.map.positions.begin(), part.map.positions.end(), whole.map.positions.begin()));
}

TEST(BackwardTracking, EachImageHasAQualityToItsKeyframe) {
  const OdometryResult result = run(turning_flight());
  const auto start = static_cast<std::size_t>(result.frames_tracked_backwards);
  double sigma_log_scale = 0.0;
  for (std::size_t i = start; i-- > 0;) {
    const FrameQuality& q = result.quality[i];
    ASSERT_TRUE(q.tracked);
    ASSERT_GE(q.keyframe, 0);
    const auto& key = result.keyframes.poses[static_cast<std::size_t>(q.keyframe)];
    EXPECT_GT(key.time_s, q.time_s - 1e-9);  // tracked to a later keyframe
    EXPECT_NEAR(q.distance_to_keyframe,
                (result.trajectory.poses[i].T_local_camera.translation - key.T_local_camera.translation).norm(), 1e-6);
    EXPECT_GT(q.sigma_position, 0.0);
    EXPECT_GT(q.known_points, 30);
    EXPECT_GE(q.sigma_log_scale, sigma_log_scale);  // it grows away from the start
    sigma_log_scale = q.sigma_log_scale;
  }
  EXPECT_GT(sigma_log_scale, 0.0);
}

TEST(BackwardTracking, IsTheSameForAnyNumberOfThreadsAndOneByOne) {
  const Sequence& flight = turning_flight();
  const auto with_threads = [&](int threads) {
    const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
    return run(flight);
  };
  const OdometryResult one = with_threads(1), two = with_threads(2);
  Odometry odometry(flight.calibration, patient_options());
  for (std::size_t i = 0; i < flight.images.size(); ++i) odometry.add(flight.images[i], static_cast<double>(i) / 30.0);
  const geometry::Trajectory so_far = odometry.trajectory();
  const OdometryResult incremental = odometry.finish();
  ASSERT_EQ(one.trajectory.size(), 60U);
  for (std::size_t i = 0; i < one.trajectory.size(); ++i) {
    const auto matrix = one.trajectory.poses[i].T_local_camera.matrix();
    EXPECT_TRUE(matrix == two.trajectory.poses[i].T_local_camera.matrix());
    EXPECT_TRUE(matrix == incremental.trajectory.poses[i].T_local_camera.matrix());
    EXPECT_TRUE(matrix == so_far.poses[i].T_local_camera.matrix());
  }
  EXPECT_TRUE(one.map.positions == two.map.positions);
}

TEST(BackwardTracking, WhatDoesNotAlignStaysWithoutAPose) {
  Sequence flight = turning_flight();
  for (const int i : {3, 4}) std::fill(flight.images[i].pixels.begin(), flight.images[i].pixels.end(), imaging::Rgb8{});
  const OdometryResult result = run(flight);
  EXPECT_EQ(result.frames_tracked, 58);
  for (const int i : {2, 5}) EXPECT_TRUE(result.quality[i].tracked) << i;
  for (const int i : {3, 4}) EXPECT_FALSE(result.quality[i].tracked) << i;
  EXPECT_EQ(result.frames_before_start - result.frames_tracked_backwards, 2);
}

TEST(BackwardTracking, TheBufferHasItsLimit) {
  const Sequence& flight = turning_flight();
  OdometryOptions options = patient_options();
  const auto start = static_cast<std::int64_t>(images_to_start(flight, options));
  const std::int64_t before_start = run(flight, options).frames_before_start;
  constexpr std::int64_t kEarlier = 6;  // pictures before the attempt that succeeds, which are kept, too
  ASSERT_GT(before_start, kEarlier);
  options.initialization.buffer_mb = static_cast<double>(start - before_start + kEarlier) * 320 * 220 * 3 / 1e6;
  const OdometryResult result = run(flight, options);
  EXPECT_GT(result.frames_tracked_backwards, 0);
  EXPECT_LE(result.frames_tracked_backwards, kEarlier + 1) << "the picture that makes the map comes after the limit";
  EXPECT_EQ(result.frames_before_start, before_start);
  EXPECT_EQ(static_cast<std::int64_t>(images_to_start(flight, options)), start);
}

TEST(BackwardTracking, ARollingShutterIsTrackedBackwards) {
  Sequence flight;
  flight.calibration.camera = imaging::make_pinhole(320, 220, 80.0);
  flight.calibration.line_delay_s = 0.6 / 30.0 / 220;
  flight.truth = path_that_begins_with_a_turn(60);
  const keyframes::test_support::ReliefCamera scene(flight.calibration.camera, hills());
  for (std::size_t i = 0; i < flight.truth.size(); ++i) {
    const SE3& pose = flight.truth[i];
    const SE3& other = flight.truth[i + 1 < flight.truth.size() ? i + 1 : i - 1];
    const double sign = i + 1 < flight.truth.size() ? 1.0 : -1.0;
    const geometry::Vec6 step = sign * (pose.inverse() * other).log();
    flight.images.push_back(
        scene.render_by_rows([&](int row) { return pose * SE3::exp((row - 109.5) / 220 * 0.6 * step); }));
  }
  const OdometryResult result = run(flight);
  EXPECT_EQ(result.frames_tracked, 60);
  EXPECT_GT(result.frames_tracked_backwards, 10);
  EXPECT_LT(relative_ate(result.trajectory, flight.truth), 0.015);
}

}  // namespace
}  // namespace tileflight::odometry::backward_tracking_test
