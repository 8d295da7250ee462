// Static stereo over whole flights: metric from the first image on, and what becomes of it when a camera fails.

#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <numbers>

#include "tileflight/core/base/input_error.h"
#include "tileflight/slam/inertial/test_smooth_motion.h"
#include "tileflight/slam/odometry/stereo_input.h"
#include "tileflight/slam/odometry/synthetic_flight.h"
#include "tileflight/slam/odometry/tracking_warnings.h"

namespace tileflight::odometry::stereo_odometry_test {
namespace {

using geometry::SE3;
using geometry::Vec3;

constexpr int kFrames = 24;
constexpr double kBaseline_m = 0.5;

SE3 T_right_left(const Vec3& turned_rad = Vec3::Zero()) {
  return SE3(geometry::so3_exp(turned_rad), Vec3(-kBaseline_m, 0, 0));
}

struct StereoFlight {
  test_support::Sequence left;
  std::vector<imaging::RgbImage> right;
  std::vector<OtherCamera> others;

  InputFrame frame(std::size_t i) const {
    InputFrame frame;
    frame.index = static_cast<std::int64_t>(i);
    frame.time_s = static_cast<double>(i) / 30.0;
    frame.image = left.images[i];
    frame.others.push_back({right[i]});
    return frame;
  }
};

/// 12 m over hills, twice as fast as the flights of other tests, a stereo pair of half a metre.
const StereoFlight& flight() {
  static const StereoFlight kFlight = [] {
    const imaging::Camera camera = imaging::make_pinhole(320, 240, 80.0);
    std::vector<SE3> path, right;
    const std::vector<SE3> slow = test_support::path_over_ground(2 * kFrames);
    for (std::size_t i = 0; i < slow.size(); i += 2) {
      path.push_back(slow[i]);
      right.push_back(slow[i] * T_right_left().inverse());
    }
    StereoFlight flight{test_support::render_sequence(camera, test_support::hilly_ground(), path), {}, {}};
    flight.right = test_support::render_sequence(camera, test_support::hilly_ground(), right).images;
    OtherCamera other{.name = "right",
                      .calibration = flight.left.calibration,
                      .photometric = {},
                      .T_other_reference = T_right_left()};
    flight.others.push_back(other);
    return flight;
  }();
  return kFlight;
}

OdometryOptions options() {
  OdometryOptions options = test_support::small_options();
  options.map.min_parallax_rad = 0.0;
  return options;
}

OdometryInput rig_input(const StereoFlight& flight) {
  OdometryInput input = flight.left.calibration;
  input.other_cameras = flight.others;
  return input;
}

OdometryResult track(const StereoFlight& flight) {
  Odometry odometry(rig_input(flight), options());
  for (std::size_t i = 0; i < flight.right.size(); ++i) odometry.add(flight.frame(i));
  return odometry.finish();
}

double scale_error(const OdometryResult& result) {
  return test_support::similarity_to_truth(result.trajectory, flight().left.truth).scale - 1.0;
}

bool warnings(const OdometryResult& result, const std::string& words) {
  const Warnings found = find_warnings(result, result.frames, [](std::int64_t i) { return std::to_string(i); });
  return std::ranges::any_of(found,
                             [&](const auto& warning) { return warning.message.find(words) != std::string::npos; });
}

imaging::RgbImage black() {
  imaging::RgbImage image(320, 240);
  return image;
}

TEST(StereoOdometry, IsMetricFromTheFirstImageOn) {
  Odometry odometry(rig_input(flight()), options());
  const FrameResult first = odometry.add(flight().frame(0));
  ASSERT_EQ(first.status, FrameStatus::kTracked);
  EXPECT_LT(first.T_map_camera->translation.norm(), 1e-9);
  const FrameResult second = odometry.add(flight().frame(1));
  ASSERT_EQ(second.status, FrameStatus::kTracked);
  const double step_m = (flight().left.truth[1].translation - flight().left.truth[0].translation).norm();
  EXPECT_NEAR(second.T_map_camera->translation.norm(), step_m, 0.05 * step_m);
}

TEST(StereoOdometry, FindsPathAndScale) {
  const OdometryResult result = track(flight());
  ASSERT_EQ(result.frames_tracked, kFrames);
  ASSERT_TRUE(result.stereo && result.stereo->metric);
  EXPECT_LT(std::abs(scale_error(result)), 0.005);
  EXPECT_LT(test_support::relative_ate(result.trajectory, flight().left.truth), 0.003);
  EXPECT_GT(result.map.size(), 300U);
  const OtherCameraResult& right = result.stereo->cameras.at(0);
  EXPECT_EQ(right.frames, kFrames);
  EXPECT_EQ(right.frames_blind, 0);
  EXPECT_GT(right.matched_share, 0.4);
  ASSERT_TRUE(right.fit);
  EXPECT_LT(right.fit->rotation_rad, 0.002);
  EXPECT_LT(right.fit->behind_share, 0.1);
  EXPECT_FALSE(warnings(result, "camera right"));
}

TEST(StereoOdometry, IsTheSameForAnyNumberOfThreads) {
  const auto track_with = [](int threads) {
    const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
    return track(flight());
  };
  const OdometryResult one = track_with(1), two = track_with(2);
  ASSERT_EQ(one.trajectory.size(), two.trajectory.size());
  for (std::size_t i = 0; i < one.trajectory.size(); ++i) {
    EXPECT_EQ(one.trajectory.poses[i].T_local_camera.translation, two.trajectory.poses[i].T_local_camera.translation);
    EXPECT_TRUE(one.trajectory.poses[i].T_local_camera.rotation.coeffs() ==
                two.trajectory.poses[i].T_local_camera.rotation.coeffs());
  }
  EXPECT_EQ(one.map.positions, two.map.positions);
}

TEST(StereoOdometry, GoesOnWithOneCameraWhenTheOtherShowsNothing) {
  StereoFlight covered = flight();
  for (std::size_t i = 8; i < covered.right.size(); ++i) covered.right[i] = black();
  const OdometryResult result = track(covered);
  EXPECT_EQ(result.frames_tracked, kFrames);
  EXPECT_TRUE(result.stereo->metric);
  EXPECT_LT(std::abs(scale_error(result)), 0.02);
  EXPECT_EQ(result.stereo->cameras[0].frames_blind, kFrames - 8);
  EXPECT_TRUE(warnings(result, "camera right shows nothing in 16 of 24 images"));
}

TEST(StereoOdometry, GoesOnWithOneCameraWhenTheOtherStops) {
  StereoFlight stopped = flight();
  for (std::size_t i = 8; i < stopped.right.size(); ++i) stopped.right[i] = {};
  const OdometryResult result = track(stopped);
  EXPECT_EQ(result.frames_tracked, kFrames);
  EXPECT_LT(std::abs(scale_error(result)), 0.02);
  EXPECT_EQ(result.stereo->cameras[0].frames, 8);
  EXPECT_TRUE(warnings(result, "camera right has no image in the last 16 frames (its last is at frame 7)"));
}

TEST(StereoOdometry, StartsWhenTheOtherCameraSeesAndTracksBackwardsFromThere) {
  StereoFlight late = flight();
  for (std::size_t i = 0; i < 4; ++i) late.right[i] = black();
  const OdometryResult result = track(late);
  EXPECT_TRUE(result.stereo->metric);
  EXPECT_EQ(result.frames_before_start, 4);
  EXPECT_EQ(result.frames_tracked, kFrames);
  EXPECT_LT(std::abs(scale_error(result)), 0.01);
}

TEST(StereoOdometry, SaysThatExchangedCamerasContradictTheirCalibration) {
  StereoFlight exchanged = flight();
  std::swap(exchanged.left.images, exchanged.right);
  const OdometryResult result = track(exchanged);
  ASSERT_TRUE(result.stereo->cameras[0].fit);
  EXPECT_GT(result.stereo->cameras[0].fit->behind_share, 0.9);
  EXPECT_TRUE(warnings(result, "camera right is on the other side of the reference camera"));
}

TEST(StereoOdometry, SaysThatATurnedCameraContradictsItsCalibration) {
  constexpr double kTurned_rad = 2.0 * std::numbers::pi / 180.0;
  // A turn about the vertical moves corners across their epipolar lines in the image's corners only, here by less than
  // is judged.
  for (const int axis : {0, 2}) {
    SCOPED_TRACE(axis);
    StereoFlight turned = flight();
    turned.others[0].T_other_reference = T_right_left(kTurned_rad * Vec3::Unit(axis));
    const OdometryResult result = track(turned);
    ASSERT_TRUE(result.stereo->cameras[0].fit);
    EXPECT_NEAR(result.stereo->cameras[0].fit->rotation_rad, kTurned_rad, 0.25 * kTurned_rad);
    EXPECT_TRUE(warnings(result, "camera right is not where its calibration says: it is turned by about"));
  }
}

TEST(StereoOdometry, ATurnAboutTheVerticalIsNamedWithWhatItDoesToDistances) {
  const OdometryResult straight = track(flight());
  ASSERT_TRUE(straight.stereo->cameras[0].turn);
  EXPECT_LT(std::abs(straight.stereo->cameras[0].turn->along_parallax_rad()), 0.0005);
  for (const double degrees : {-0.3, 0.2, 0.5}) {
    SCOPED_TRACE(degrees);
    const double turned_rad = degrees * std::numbers::pi / 180.0;
    StereoFlight turned = flight();
    turned.others[0].T_other_reference = T_right_left(turned_rad * Vec3::UnitY());
    const OdometryResult result = track(turned);
    ASSERT_TRUE(result.stereo->metric);
    ASSERT_TRUE(result.stereo->cameras[0].turn);
    const RigTurn& turn = *result.stereo->cameras[0].turn;
    EXPECT_NEAR(std::abs(turn.along_parallax_rad()), std::abs(turned_rad), 0.15 * std::abs(turned_rad) + 0.0002);
    EXPECT_GT(std::abs(scale_error(result)), 0.01);
    EXPECT_NEAR(turn.distance_error(), -scale_error(result), 0.5 * std::abs(scale_error(result)));
    EXPECT_TRUE(warnings(result, "so that the scale of the map is wrong: by the rig, half of the distances are too"));
  }
}

void expect_error(const std::function<void()>& call, const std::string& words) {
  try {
    call();
    ADD_FAILURE() << "no error; expected: " << words;
  } catch (const InputError& error) {
    EXPECT_NE(std::string(error.what()).find(words), std::string::npos) << error.what();
  }
}

TEST(StereoOdometry, RefusesRigsThatItCannotUse) {
  const auto with = [](const std::function<void(OdometryInput&)>& change) {
    return [change] {
      OdometryInput input = rig_input(flight());
      change(input);
      Odometry odometry(std::move(input), options());
    };
  };
  expect_error(with([](auto& input) { input.other_cameras[0].T_other_reference = {}; }),
               "camera right: is where the reference camera is");
  expect_error(with([](auto& input) { input.other_cameras[0].calibration.line_delay_s = 1e-5; }),
               "camera right: has a rolling shutter");
  expect_error(with([](auto& input) { input.calibration.line_delay_s = 1e-5; }), "rolling shutter");
  expect_error(with([](auto& input) { input.other_cameras[0].calibration = {}; }), "no image size");
  expect_error(with([](auto& input) { input.other_cameras.resize(5, input.other_cameras[0]); }),
               "5 cameras are given besides the reference camera; at most 4");
  expect_error(with([](auto& input) { input.poses.poses.resize(2); }), "scale and frame come from one of them");
}

TEST(StereoOdometry, RefusesImagesThatDoNotBelongToTheRigAndStaysUsable) {
  Odometry odometry(rig_input(flight()), options());
  InputFrame small = flight().frame(0), many = flight().frame(0);
  small.others[0].image = imaging::RgbImage(100, 80);
  many.others.resize(2);
  expect_error([&] { odometry.add(small); }, "camera right: its image is 100x80, its calibration is for 320x240");
  expect_error([&] { odometry.add(many); }, "has images of 2 other cameras, the rig has 1");
  EXPECT_EQ(odometry.add(flight().frame(0)).status, FrameStatus::kTracked);
}

TEST(IsBlind, TellsBlackAndCoveredPicturesFromOthers) {
  EXPECT_TRUE(is_blind(black()));
  imaging::RgbImage covered(320, 240);
  for (std::size_t i = 0; i < covered.pixels.size(); ++i) {
    const auto grey = static_cast<std::uint8_t>(20 + (i * 7919 + i / 320) % 4);
    covered.pixels[i] = {grey, grey, grey};
  }
  EXPECT_TRUE(is_blind(covered));
  EXPECT_FALSE(is_blind(flight().right[0]));
}

/// The readings along the flight's path, of a unit that sits where the camera is.
inertial::InertialInput readings() {
  const auto camera = [](double t) {
    const double s = 2.0 * t;
    return keyframes::test_support::look_along(Vec3(3.0 * s, 5.0 * s, 12.0 + 0.5 * std::sin(s)),
                                               Vec3(0.3 * std::sin(s), 1.0, -1.1));
  };
  const inertial::test_support::SmoothMotion motion{[=](double t) { return Vec3(camera(t).translation); },
                                                    [=](double t) { return camera(t).rotation; }};
  inertial::InertialInput input;
  input.samples = motion.readings(-0.1, kFrames / 30.0 + 0.1, 200.0, {{0.005, -0.01, 0.01}, {0.02, -0.01, 0.03}});
  inertial::test_support::add_noise({}, 200.0, 2, input.samples);
  input.model.accelerometer_bias_sigma = 0.05;
  return input;
}

// Less than a second, whose accelerations do not show the scale: it is the rig's; the readings add the vertical.
TEST(StereoOdometry, WithAnInertialUnitTheMapIsLevelToo) {
  OdometryInput input = rig_input(flight());
  input.inertial = readings();
  Odometry odometry(input, options());
  for (std::size_t i = 0; i < flight().right.size(); ++i) odometry.add(flight().frame(i));
  const OdometryResult result = odometry.finish();
  ASSERT_EQ(result.frames_tracked, kFrames);
  ASSERT_TRUE(result.stereo && result.stereo->metric);
  ASSERT_TRUE(result.inertial && result.inertial->metric) << result.inertial->reason;
  EXPECT_TRUE(result.inertial->was_metric);
  EXPECT_LT(std::abs(scale_error(result)), 0.005);
  const geometry::Sim3 T = test_support::similarity_to_truth(result.trajectory, flight().left.truth);
  EXPECT_LT(std::acos((T.rotation * Vec3::UnitZ()).z()), 0.02);
}

TEST(StereoOdometry, WithReadingsThatShowNothingTheMapIsTheRigs) {
  OdometryInput input = rig_input(flight());
  input.inertial = readings();
  input.inertial->samples.resize(60);  // of 200
  Odometry odometry(input, options());
  for (std::size_t i = 0; i < flight().right.size(); ++i) odometry.add(flight().frame(i));
  const OdometryResult result = odometry.finish(), rig = track(flight());
  ASSERT_TRUE(result.stereo && result.stereo->metric);
  ASSERT_TRUE(result.inertial);
  EXPECT_FALSE(result.inertial->metric);
  ASSERT_FALSE(result.inertial->warnings.empty());
  EXPECT_NE(result.inertial->warnings.back().message.find("the map is not level"), std::string::npos);
  EXPECT_EQ(result.map.positions, rig.map.positions);
}

}  // namespace
}  // namespace tileflight::odometry::stereo_odometry_test
