// Odometry, one image at a time, against the batch over the same images: bit for bit.

#include "tileflight/slam/odometry/odometry.h"

// Before any other header: the public one brings no parser of files or messages along; json_fwd.hpp only declares.
#if defined(YAML_CPP_API) || defined(INCLUDE_NLOHMANN_JSON_HPP_) || defined(MSGPACK_VERSION_MAJOR)
#error "odometry.h includes yaml-cpp, nlohmann/json or msgpack"
#endif

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "tileflight/core/base/input_error.h"
#include "tileflight/slam/odometry/synthetic_flight.h"

namespace tileflight::odometry::incremental_odometry_test {
namespace {

using geometry::SE3;
using test_support::small_options;
using testing::HasSubstr;
using testing::ThrowsMessage;

const test_support::Sequence& hill_flight() {
  static const test_support::Sequence kFlight =
      test_support::render_hill_flight(imaging::make_fisheye(320, 200, 130.0), 40);
  return kFlight;
}

/// The flight with pictures `from` to `to` black.
test_support::Sequence interrupted_flight(std::size_t from, std::size_t to) {
  test_support::Sequence flight = hill_flight();
  for (std::size_t i = from; i < to; ++i)
    std::fill(flight.images[i].pixels.begin(), flight.images[i].pixels.end(), imaging::Rgb8{});
  return flight;
}

double time_s(std::size_t i) { return static_cast<double>(i) / 30.0; }

/// Adds pictures from `begin` to `end` (or the last).
std::vector<FrameResult> add_frames(Odometry& odometry, const test_support::Sequence& flight, std::size_t begin = 0,
                                    std::size_t end = std::numeric_limits<std::size_t>::max()) {
  std::vector<FrameResult> results;
  for (std::size_t i = begin; i < std::min(end, flight.images.size()); ++i)
    results.push_back(odometry.add(flight.images[i], time_s(i)));
  return results;
}

bool same_pose(const SE3& a, const SE3& b) {
  return a.translation == b.translation && a.rotation.coeffs() == b.rotation.coeffs();
}

void expect_same_trajectory(const geometry::Trajectory& a, const geometry::Trajectory& b) {
  ASSERT_EQ(a.size(), b.size());
  for (std::size_t i = 0; i < a.size(); ++i) {
    EXPECT_EQ(a.poses[i].time_s, b.poses[i].time_s);
    EXPECT_TRUE(same_pose(a.poses[i].T_local_camera, b.poses[i].T_local_camera)) << i;
  }
}

void expect_same_quality(const FrameQuality& a, const FrameQuality& b) {
  EXPECT_EQ(a.frame, b.frame);
  EXPECT_EQ(a.time_s, b.time_s);
  EXPECT_EQ(a.tracked, b.tracked);
  EXPECT_EQ(a.is_keyframe, b.is_keyframe);
  EXPECT_EQ(a.keyframe, b.keyframe);
  EXPECT_EQ(a.rmse, b.rmse);
  EXPECT_EQ(a.inside_share, b.inside_share);
  EXPECT_EQ(a.saturated_share, b.saturated_share);
  EXPECT_EQ(a.known_points, b.known_points);
  EXPECT_EQ(a.sigma_position, b.sigma_position);
  EXPECT_EQ(a.sigma_rotation_rad, b.sigma_rotation_rad);
  EXPECT_EQ(a.sigma_log_scale, b.sigma_log_scale);
}

/// Everything but the times that the computation took.
void expect_same_result(const OdometryResult& a, const OdometryResult& b) {
  expect_same_trajectory(a.trajectory, b.trajectory);
  expect_same_trajectory(a.keyframes, b.keyframes);
  EXPECT_TRUE(a.map.positions == b.map.positions);
  EXPECT_TRUE(a.map.colors == b.map.colors);
  EXPECT_TRUE(a.map.scalars == b.map.scalars);
  EXPECT_EQ(a.keyframe_frame_indices, b.keyframe_frame_indices);
  EXPECT_EQ(a.map_point_keyframes, b.map_point_keyframes);
  EXPECT_EQ(a.frames, b.frames);
  EXPECT_EQ(a.frames_tracked, b.frames_tracked);
  EXPECT_EQ(a.relocalizations, b.relocalizations);
  EXPECT_EQ(a.lost, b.lost);
  EXPECT_EQ(a.lost_reason, b.lost_reason);
  ASSERT_EQ(a.quality.size(), b.quality.size());
  for (std::size_t i = 0; i < a.quality.size(); ++i) {
    expect_same_quality(a.quality[i], b.quality[i]);
    EXPECT_EQ(a.quality[i].distance_to_keyframe, b.quality[i].distance_to_keyframe);
  }
  ASSERT_EQ(a.systematic_displacement.has_value(), b.systematic_displacement.has_value());
  if (a.systematic_displacement) {
    EXPECT_EQ(a.systematic_displacement->rms_px, b.systematic_displacement->rms_px);
  }
  ASSERT_EQ(a.camera.has_value(), b.camera.has_value());
}

void expect_same_as_batch(const test_support::Sequence& flight, const OdometryOptions& options) {
  Odometry odometry(flight.calibration, options);
  add_frames(odometry, flight);
  expect_same_result(odometry.finish(), run_odometry(flight.calibration, flight.source(), options));
}

TEST(IncrementalOdometry, EqualsTheBatch) { expect_same_as_batch(hill_flight(), small_options()); }

TEST(IncrementalOdometry, EqualsTheBatchThatRecovers) {
  expect_same_as_batch(interrupted_flight(30, 33), small_options());
}

TEST(IncrementalOdometry, EqualsTheBatchThatStopsReadingWhereItIsLost) {
  OdometryOptions options = small_options();
  options.tracking.max_failed_frames = 2;
  expect_same_as_batch(interrupted_flight(25, 35), options);
}

TEST(IncrementalOdometry, EqualsTheBatchWithoutAMap) {
  test_support::Sequence flight = hill_flight();
  flight.images.resize(3);
  expect_same_as_batch(flight, small_options());
}

TEST(IncrementalOdometry, PriorPosesOneByOneEqualThoseGivenAtOnce) {
  const test_support::Sequence& flight = hill_flight();
  OdometryInput input = flight.calibration;
  Odometry odometry(flight.calibration, small_options());
  for (std::size_t i = 0; i < flight.images.size(); ++i) {
    input.poses.poses.push_back({time_s(i), flight.truth[i]});
    odometry.add(flight.images[i], time_s(i), flight.truth[i]);
  }
  const auto T_world_map = odometry.T_world_map();
  const geometry::Trajectory before = odometry.trajectory();
  const OdometryResult result = odometry.finish();
  expect_same_result(result, run_odometry(input, flight.source(), small_options()));
  ASSERT_TRUE(T_world_map.has_value());
  expect_same_trajectory(geometry::transformed(*T_world_map, before), result.trajectory);
}

TEST(IncrementalOdometry, PosesComeAtOnceAndTheirRefinementIsSmall) {
  const test_support::Sequence& flight = hill_flight();
  Odometry odometry(flight.calibration, small_options());
  const std::vector<FrameResult> frames = add_frames(odometry, flight);
  const OdometryResult result = odometry.finish();
  ASSERT_EQ(result.frames_tracked, static_cast<std::int64_t>(frames.size()));
  const auto first = std::find_if(frames.begin(), frames.end(), [](const FrameResult& f) { return !!f.T_map_camera; });
  ASSERT_NE(first, frames.end());
  EXPECT_GT(first - frames.begin(), 2);  // images are needed before there is a map
  std::size_t keyframes = 0;
  const double path = geometry::path_length_m(result.trajectory);
  for (std::size_t i = 0; i < frames.size(); ++i) {
    const bool is_tracked = i >= static_cast<std::size_t>(first - frames.begin());
    ASSERT_EQ(frames[i].status, is_tracked ? FrameStatus::kTracked : FrameStatus::kInitializing);
    ASSERT_EQ(frames[i].T_map_camera.has_value(), is_tracked);
    EXPECT_EQ(frames[i].reason.empty(), is_tracked);
    EXPECT_EQ(frames[i].quality.frame, static_cast<std::int64_t>(i));
    if (!is_tracked) continue;
    const SE3& refined = result.trajectory.poses[i].T_local_camera;
    EXPECT_LT((frames[i].T_map_camera->translation - refined.translation).norm(), 0.01 * path);
    EXPECT_LT(frames[i].T_map_camera->rotation.angularDistance(refined.rotation), 0.01);
    expect_same_quality(frames[i].quality, result.quality[i]);
    keyframes += frames[i].quality.is_keyframe;
  }
  EXPECT_GT(keyframes, 1U);
  // The image with which the map begins is tracked, and so is the last one, whose pose nothing refines any more.
  EXPECT_TRUE(first->quality.is_keyframe);
  EXPECT_LT(
      (frames.back().T_map_camera->translation - result.trajectory.poses.back().T_local_camera.translation).norm(),
      1e-9 * path);
}

TEST(IncrementalOdometry, SaysThatAnImageDoesNotAlignAndThatItIsLost) {
  OdometryOptions options = small_options();
  options.tracking.max_failed_frames = 2;
  const test_support::Sequence flight = interrupted_flight(25, 30);
  Odometry odometry(flight.calibration, options);
  const std::vector<FrameResult> frames = add_frames(odometry, flight);
  EXPECT_EQ(frames[24].status, FrameStatus::kTracked);
  for (const std::size_t i : {25, 26}) {
    EXPECT_EQ(frames[i].status, FrameStatus::kNotAligned);
    EXPECT_THAT(frames[i].reason, HasSubstr("frame " + std::to_string(i)));
    EXPECT_FALSE(frames[i].T_map_camera.has_value());
  }
  for (std::size_t i = 27; i < frames.size(); ++i) EXPECT_EQ(frames[i].status, FrameStatus::kLost);
  EXPECT_TRUE(odometry.lost());
  EXPECT_EQ(odometry.frames(), 28);
}

TEST(IncrementalOdometry, ShowsTheMapSoFar) {
  const test_support::Sequence& flight = hill_flight();
  Odometry odometry(flight.calibration, small_options());
  add_frames(odometry, flight, 0, 2);
  EXPECT_TRUE(odometry.trajectory().empty());
  EXPECT_TRUE(odometry.keyframes().empty());
  EXPECT_TRUE(odometry.map().empty());
  EXPECT_FALSE(odometry.T_world_map().has_value());
  add_frames(odometry, flight, 2);
  // Without loop closure and priors, what is there after the last image is the result.
  const geometry::Trajectory trajectory = odometry.trajectory(), keyframes = odometry.keyframes();
  const geometry::PointCloud map = odometry.map();
  EXPECT_FALSE(odometry.T_world_map().has_value());
  const OdometryResult result = odometry.finish();
  expect_same_trajectory(trajectory, result.trajectory);
  expect_same_trajectory(keyframes, result.keyframes);
  EXPECT_TRUE(map.positions == result.map.positions);
  EXPECT_TRUE(map.scalars == result.map.scalars);
}

TEST(IncrementalOdometry, AWrongCallIsRefusedAndChangesNothing) {
  const test_support::Sequence& flight = hill_flight();
  const imaging::RgbImage& image = flight.images[30];
  const auto refusal = [](const std::string& text) { return ThrowsMessage<InputError>(HasSubstr(text)); };
  Odometry odometry(flight.calibration, small_options());
  EXPECT_THAT([&] { odometry.add(image, std::nan("")); }, refusal("frame 0: its time is not a finite number"));
  add_frames(odometry, flight, 0, 30);
  EXPECT_THAT([&] { odometry.add(imaging::RgbImage(100, 100), time_s(30)); }, refusal("frame 30: is 100x100"));
  EXPECT_THAT([&] { odometry.add(image, time_s(29)); }, refusal("is not after that of the frame before"));
  EXPECT_THAT([&] { odometry.add(image, std::numeric_limits<double>::infinity()); }, refusal("not a finite number"));
  EXPECT_THAT([&] { odometry.add(InputFrame{.index = 29, .time_s = time_s(30), .image = image}); },
              refusal("its index is not greater"));
  SE3 infinite;
  infinite.translation.x() = std::numeric_limits<double>::infinity();
  EXPECT_THAT([&] { odometry.add(image, time_s(30), infinite); }, refusal("its prior pose is not finite"));
  add_frames(odometry, flight, 30);
  expect_same_result(odometry.finish(), run_odometry(flight.calibration, flight.source(), small_options()));
}

TEST(IncrementalOdometry, NothingGoesAfterTheEnd) {
  const auto refusal = ThrowsMessage<InputError>(HasSubstr("odometry: is finished"));
  Odometry odometry(hill_flight().calibration);
  EXPECT_EQ(odometry.finish().lost_reason, "no images");
  EXPECT_THAT([&] { odometry.add(hill_flight().images[0], 0.0); }, refusal);
  EXPECT_THAT([&] { odometry.finish(); }, refusal);
  EXPECT_THAT([&] { odometry.map(); }, refusal);
  odometry = Odometry(hill_flight().calibration);
  EXPECT_EQ(odometry.add(hill_flight().images[0], 0.0).status, FrameStatus::kInitializing);
}

TEST(IncrementalOdometry, PriorPosesAreGivenInOneWay) {
  OdometryInput input = hill_flight().calibration;
  input.poses.poses.push_back({0.0, SE3()});
  Odometry odometry(input, small_options());
  EXPECT_THAT([&] { odometry.add(hill_flight().images[0], 0.0, SE3()); },
              ThrowsMessage<InputError>(HasSubstr("all prior poses were given at the start")));
}

TEST(IncrementalOdometry, ACalibrationHasAnImageSize) {
  EXPECT_THAT([] { Odometry odometry{imaging::Calibration()}; },
              ThrowsMessage<InputError>(HasSubstr("calibration: has no image size")));
}

TEST(IncrementalOdometry, GoesOnAfterAMove) {
  const test_support::Sequence& flight = hill_flight();
  Odometry first(flight.calibration, small_options());
  add_frames(first, flight, 0, 20);
  Odometry second = std::move(first);
  add_frames(second, flight, 20);
  expect_same_result(second.finish(), run_odometry(flight.calibration, flight.source(), small_options()));
}

}  // namespace
}  // namespace tileflight::odometry::incremental_odometry_test
