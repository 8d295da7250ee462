#include "tileflight/slam/odometry/prior_alignment.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tileflight/core/base/input_error.h"
#include "tileflight/slam/odometry/synthetic_flight.h"

namespace tileflight::odometry::prior_alignment_test {
namespace {

using geometry::SE3;
using geometry::Sim3;
using geometry::Vec3;
using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

TEST(PriorAlignment, SimilarityOfPosesIsFoundOnAStraightLineToo) {
  const Sim3 expected(2.5, geometry::so3_exp({0.3, -0.8, 1.2}), Vec3(10, -20, 5));
  std::vector<SE3> map, world;
  for (int i = 0; i < 5; ++i) {
    map.emplace_back(geometry::so3_exp({0.1 * i, 0.05 * i, -0.02}), Vec3(0.3 * i, 0.6 * i, 0.0));
    world.push_back(expected * map.back());
  }
  const auto found = similarity_from_poses(map, world);
  ASSERT_TRUE(found);
  EXPECT_TRUE(found->matrix().isApprox(expected.matrix(), 1e-12));
  EXPECT_FALSE(similarity_from_poses({map[0]}, {world[0]}));
  EXPECT_FALSE(similarity_from_poses({map[0], map[1]}, {world[0], world[0]}));
}

TEST(PriorAlignment, VariancesGoWithTheSquareOfTheScale) {
  OdometryResult result;
  result.map.positions = {Vec3(0, 0, 4)};
  result.map.scalars["inverse_depth_variance"] = {1e-4F};
  transform_result(Sim3(10.0, Eigen::Quaterniond::Identity(), Vec3(1, 0, 0)), result);
  EXPECT_EQ(result.map.positions[0], Vec3(1, 0, 40));
  EXPECT_NEAR(result.map.scalars["inverse_depth_variance"][0], 1e-6, 1e-12);
}

const test_support::Sequence& flight() {
  static const test_support::Sequence kFlight =
      test_support::render_hill_flight(imaging::make_fisheye(280, 180, 130.0), 30);
  return kFlight;
}

geometry::Trajectory true_poses() {
  geometry::Trajectory poses;
  for (std::size_t i = 0; i < flight().truth.size(); ++i)
    poses.poses.push_back({static_cast<double>(i) / 30.0, flight().truth[i]});
  return poses;
}

OdometryResult run(const OdometryInput& input) {
  return run_odometry(input, flight().source(), test_support::small_options());
}

TEST(PriorAlignment, PosesGiveFrameAndScale) {
  OdometryInput input = flight().calibration;
  input.poses = true_poses();
  const OdometryResult result = run(input);
  ASSERT_FALSE(result.lost) << result.lost_reason;
  const double path_m = geometry::path_length_m(input.poses);
  ASSERT_FALSE(result.trajectory.empty());
  for (const geometry::StampedPose& pose : result.trajectory.poses) {
    const SE3& truth = flight().truth[std::lround(pose.time_s * 30.0)];
    EXPECT_LT((pose.T_local_camera.translation - truth.translation).norm(), 0.02 * path_m);
    EXPECT_LT(pose.T_local_camera.rotation.angularDistance(truth.rotation), 0.01);
  }
  std::vector<double> heights;
  for (const Vec3& p : result.map.positions)
    heights.push_back(std::abs(p.z() - test_support::hilly_ground().height_m(p.x(), p.y())));
  EXPECT_LT(base::upper_median(heights), 0.2);
}

TEST(PriorAlignment, DepthGivesTheScale) {
  OdometryInput input = flight().calibration;
  input.depth_m = [](std::int64_t index) -> std::optional<imaging::FloatImage> {
    if (index > 3) return std::nullopt;
    const imaging::Camera& camera = flight().calibration.camera;
    imaging::FloatImage depth(camera.width(), camera.height());
    const SE3& pose = flight().truth[index];
    for (int y = 0; y < depth.height; ++y)
      for (int x = 0; x < depth.width; ++x) {
        const auto ray = camera.unproject({x, y});
        if (!ray) continue;
        depth(x, y) =
            static_cast<float>(ray->z() * keyframes::test_support::hit_distance(
                                              test_support::hilly_ground(), pose.translation, pose.rotation * *ray));
      }
    return depth;
  };
  const OdometryResult result = run(input);
  ASSERT_FALSE(result.lost) << result.lost_reason;
  EXPECT_NEAR(test_support::similarity_to_truth(result.trajectory, flight().truth).scale, 1.0, 0.03);
}

TEST(PriorAlignment, PosesOfAnotherTimeAndDepthWithoutPointsAreRefused) {
  OdometryInput input = flight().calibration;
  input.poses = true_poses();
  for (geometry::StampedPose& pose : input.poses.poses) pose.time_s += 1000.0;
  EXPECT_THAT([&] { run(input); }, ThrowsMessage<InputError>(HasSubstr("check that both have the same clock")));
  OdometryInput empty = flight().calibration;
  empty.depth_m = [](std::int64_t) { return std::optional<imaging::FloatImage>(); };
  EXPECT_THAT([&] { run(empty); },
              ThrowsMessage<InputError>(HasSubstr("no point of the first keyframes has a known depth")));
  OdometryInput other_size = flight().calibration;
  other_size.depth_m = [](std::int64_t) {
    return std::optional<imaging::FloatImage>(imaging::FloatImage(10, 10, 5.0F));
  };
  EXPECT_THAT([&] { run(other_size); },
              ThrowsMessage<InputError>(HasSubstr("depth: is 10x10, the calibration is for")));
}

}  // namespace
}  // namespace tileflight::odometry::prior_alignment_test
