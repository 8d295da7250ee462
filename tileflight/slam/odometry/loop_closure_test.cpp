// Loop closure on keyframes over rendered ground, with artificial drift.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <numbers>
#include <random>

#include "tileflight/slam/loop_closure/loop_correction.h"
#include "tileflight/slam/odometry/test_synthetic_keyframes.h"

namespace tileflight::odometry::loop_closure_test {
namespace {

using geometry::SE3;
using geometry::Sim3;
using geometry::Vec3;
using test_support::KeyframeMaker;

/// A circular path of 1.2 turns over a place; the camera looks forward and down.
std::vector<SE3> round_trip(int keyframes) {
  constexpr double kRadius_m = 25.0;
  std::vector<SE3> path;
  for (int i = 0; i < keyframes; ++i) {
    const double angle = 1.2 * 2.0 * std::numbers::pi * i / keyframes;
    const Vec3 place(kRadius_m * std::cos(angle), kRadius_m * std::sin(angle), 13.0 + 0.4 * std::sin(3.0 * angle));
    path.push_back(keyframes::test_support::look_along(place, Vec3(-std::sin(angle), std::cos(angle), -1.5)));
  }
  return path;
}

/// Keyframes and their points, as a map knows them.
struct Flight {
  std::vector<loop_closure::LoopKeyframe> keyframes;
  std::vector<mapping::MapPoint> points;
};

const Vec3 kTurn_rad(0.0004, -0.0006, 0.0003);  ///< drift of a step

/// A flight with drift of rotation and scale: at its end the map is `last_scale` times too large.
Flight drifted(const KeyframeMaker& maker, const std::vector<SE3>& truth, double last_scale) {
  Flight flight;
  SE3 pose = truth.front();
  geometry::Vec6 variance;
  variance << Vec3::Constant(1e-4), kTurn_rad.cwiseAbs2();
  const double log_scale_step = std::log(last_scale) / static_cast<double>(truth.size());
  for (std::size_t i = 0; i < truth.size(); ++i) {
    const double scale = std::exp(log_scale_step * static_cast<double>(i));
    if (i > 0) {
      SE3 step = truth[i - 1].inverse() * truth[i];
      step.translation *= scale;
      pose = pose * SE3(geometry::so3_exp(kTurn_rad) * step.rotation, step.translation);
    }
    loop_closure::LoopKeyframe keyframe{.id = static_cast<int>(i),
                                        .frame_index = static_cast<std::int64_t>(10 * i),
                                        .T_map_camera = pose,
                                        .features = maker.features(truth[i]),
                                        .image = maker.image(truth[i]),
                                        .step_covariance = variance.asDiagonal(),
                                        .step_log_scale_variance = log_scale_step * log_scale_step + 1e-8};
    for (loop_closure::Feature& feature : keyframe.features) feature.rho /= static_cast<float>(scale);
    for (mapping::MapPoint& point : maker.points(truth[i], keyframe.id)) {
      point.rho /= static_cast<float>(scale);
      point.rho_variance /= static_cast<float>(scale * scale);
      flight.points.push_back(point);
    }
    flight.keyframes.push_back(std::move(keyframe));
  }
  return flight;
}

double ate_share_of(const std::vector<SE3>& poses, const std::vector<SE3>& truth) {
  geometry::Trajectory trajectory;
  for (std::size_t i = 0; i < poses.size(); ++i) trajectory.poses.push_back({static_cast<double>(i), poses[i]});
  return test_support::relative_ate(trajectory, truth, 1.0);
}

std::vector<SE3> poses_of(const std::vector<loop_closure::LoopKeyframe>& keyframes) {
  std::vector<SE3> poses;
  for (const loop_closure::LoopKeyframe& keyframe : keyframes) poses.push_back(keyframe.T_map_camera);
  return poses;
}

TEST(LoopClosure, AFlightThatReturnsLosesMostOfItsDrift) {
  const KeyframeMaker maker(test_support::hilly_terrain());
  const std::vector<SE3> truth = round_trip(60);
  const auto [keyframes, points] = drifted(maker, truth, 1.15);
  const std::vector<loop_closure::Loop> loops = loop_closure::find_loops(keyframes, {});
  ASSERT_GT(loops.size(), 5U);
  for (const loop_closure::Loop& loop : loops) {
    EXPECT_LT((truth[loop.from].translation - truth[loop.to].translation).norm(), 16.0) << loop.from << " " << loop.to;
    EXPECT_NEAR(loop.T_from_to.scale, std::pow(1.15, (loop.from - loop.to) / 60.0), 0.01);
  }
  std::vector<SE3> closed;
  const std::vector<loop_closure::MeasuredLoop> measured =
      loop_closure::measure_loops(maker.lens(), points, keyframes, loops);
  ASSERT_GT(measured.size(), 5U);
  const std::vector<Sim3> similarities = loop_closure::correct_poses(keyframes, measured).value();
  for (const Sim3& pose : similarities) closed.emplace_back(pose.rotation, pose.translation);
  const double before = ate_share_of(poses_of(keyframes), truth), after = ate_share_of(closed, truth);
  std::printf("ATE, %% of path: %.3f before, %.3f after %zu loops\n", 100 * before, 100 * after, loops.size());
  EXPECT_LT(after, before / 4);
  EXPECT_EQ(closed.front().translation, keyframes.front().T_map_camera.translation);
  // The scale is the same at both ends: keyframe 59 is where keyframe 9 was.
  EXPECT_NEAR(similarities[59].scale * std::pow(1.15, 59 / 60.0), similarities[9].scale * std::pow(1.15, 9 / 60.0),
              0.02);
}

/// A flight of 12 m over hills and back beside it, with noise of the images.
test_support::Sequence there_and_back() {
  constexpr int kImages = 110;
  std::vector<SE3> truth;
  for (int i = 0; i < kImages; ++i) {
    const double phase = 2.0 * std::numbers::pi * i / (kImages - 1), along = 1.0 - std::cos(phase);
    truth.push_back(keyframes::test_support::look_along(
        Vec3(3.5 * along + 0.5 * std::sin(phase), 5.0 * along, 12.0 + 0.3 * std::sin(2.0 * phase)),
        Vec3(0.2 * std::sin(phase), 1.0, -1.1)));
  }
  test_support::Sequence sequence = test_support::render_sequence(imaging::make_fisheye(320, 240, 120.0),
                                                                  test_support::hilly_ground(), std::move(truth));
  std::mt19937 random(7);
  for (imaging::RgbImage& image : sequence.images) {
    for (imaging::Rgb8& pixel : image.pixels) {
      const int off = static_cast<int>(random() % 10U + random() % 10U) - 9;  // deviation of 4 grey values
      pixel.fill(static_cast<std::uint8_t>(std::clamp(pixel[0] + off, 0, 255)));
    }
  }
  return sequence;
}

TEST(LoopClosure, AWholeFlightThereAndBackBecomesNoWorse) {
  const test_support::Sequence sequence = there_and_back();
  keyframes::OdometryOptions options = test_support::small_options();
  const OdometryResult without = run_odometry(sequence.calibration, sequence.source(), options);
  options.loops.enabled = true;
  const OdometryResult with = run_odometry(sequence.calibration, sequence.source(), options);
  ASSERT_EQ(with.frames_tracked, static_cast<std::int64_t>(sequence.images.size()));
  const double before = test_support::relative_ate(without.trajectory, sequence.truth),
               after = test_support::relative_ate(with.trajectory, sequence.truth);
  std::printf("ATE, %% of path: %.4f before, %.4f after %zu loops, closed: %d\n", 100 * before, 100 * after,
              with.loops.size(), with.loops_closed);
  EXPECT_FALSE(with.loops.empty());
  EXPECT_LE(after, 1.02 * before);
  EXPECT_TRUE(with.loops_closed || after == before);
}

TEST(LoopClosure, NothingIsFoundOnAWayThatDoesNotReturn) {
  const KeyframeMaker maker(test_support::hilly_terrain());
  std::vector<SE3> truth;
  for (int i = 0; i < 30; ++i)
    truth.push_back(keyframes::test_support::look_along(Vec3(0, 3.0 * i, 13), Vec3(0, 1, -1.5)));
  const std::vector<loop_closure::LoopKeyframe> keyframes = drifted(maker, truth, 1.05).keyframes;
  EXPECT_TRUE(loop_closure::find_loops(keyframes, {}).empty());
  EXPECT_FALSE(loop_closure::correct_poses(keyframes, {}));
}

TEST(LoopClosure, GroundThatRepeatsIsNotTakenForAReturn) {
  for (const double period_m : {3.0, 30.0}) {  // repeats many times in each image; less than once
    keyframes::test_support::Relief relief = test_support::hilly_terrain();
    relief.height_m = [](double, double) { return 0.0; };
    relief.highest_m = 0.0;
    relief.period_m = period_m;
    std::vector<SE3> truth;
    for (int i = 0; i < 30; ++i)
      truth.push_back(keyframes::test_support::look_along(Vec3(0, 3.0 * i, 13), Vec3(0, 1, -1.5)));
    EXPECT_TRUE(loop_closure::find_loops(drifted(KeyframeMaker(relief), truth, 1.05).keyframes, {}).empty())
        << period_m;
  }
}

TEST(LoopClosure, DistancesComeFromThePointsAboutACorner) {
  const KeyframeMaker maker(test_support::hilly_terrain());
  const SE3 host = keyframes::test_support::look_along(Vec3(0, 0, 13), Vec3(0, 1, -1.5)),
            other = keyframes::test_support::look_along(Vec3(1, 0.5, 13), Vec3(0, 1, -1.5));
  std::vector<loop_closure::LoopKeyframe> keyframes{{3, 0, host, maker.features(host)},
                                                    {4, 1, other, maker.features(other)}};
  // All points are hosted by the first keyframe; the second sees them from the side.
  const std::vector<mapping::MapPoint> points = maker.points(host, 3);
  const std::vector<loop_closure::Feature> truth = keyframes[1].features;
  loop_closure::assign_feature_depths(maker.lens().lenses[0], points, keyframes);
  int known = 0;
  for (std::size_t i = 0; i < truth.size(); ++i) {
    const float rho = keyframes[1].features[i].rho;
    if (rho == 0.0F) continue;
    ++known;
    EXPECT_NEAR(rho, truth[i].rho, 0.12F * truth[i].rho);
  }
  EXPECT_GT(known, static_cast<int>(truth.size()) / 3);
}

TEST(LoopClosure, PointsKeepTheirPlaceInThePictureWhenTheirHostIsScaled) {
  std::vector<mapping::MapPoint> points(2);
  points[0].keyframe = 1, points[0].rho = 0.5F, points[0].rho_variance = 0.01F;
  points[1].keyframe = 2, points[1].rho = 0.5F, points[1].rho_variance = 0.01F;
  loop_closure::rescale_points({{1, 2.0}}, points);
  EXPECT_FLOAT_EQ(points[0].rho, 0.25F);
  EXPECT_FLOAT_EQ(points[0].rho_variance, 0.0025F);
  EXPECT_FLOAT_EQ(points[1].rho, 0.5F);
}

TEST(LoopClosure, AWholeFlightWithoutReturnIsTheSameToTheLastBit) {
  const imaging::Camera camera = imaging::make_fisheye(240, 160, 120.0);
  const test_support::Sequence sequence = test_support::render_hill_flight(camera, 40);
  keyframes::OdometryOptions options = test_support::small_options();
  const OdometryResult without = run_odometry(sequence.calibration, sequence.source(), options);
  options.loops.enabled = true;
  const OdometryResult with = run_odometry(sequence.calibration, sequence.source(), options);
  EXPECT_TRUE(with.loops.empty());
  ASSERT_GT(without.frames_tracked, 30);
  ASSERT_EQ(with.trajectory.size(), without.trajectory.size());
  for (std::size_t i = 0; i < with.trajectory.size(); ++i)
    EXPECT_EQ(with.trajectory.poses[i].T_local_camera.matrix(), without.trajectory.poses[i].T_local_camera.matrix());
  EXPECT_EQ(with.map.positions, without.map.positions);
  EXPECT_EQ(with.map.scalars, without.map.scalars);
}

}  // namespace
}  // namespace tileflight::odometry::loop_closure_test
