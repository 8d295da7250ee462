#include "tileflight/evaluation/registration/located_poses.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tileflight/core/base/input_error.h"
#include "tileflight/evaluation/registration/test_flights.h"

namespace tileflight::registration::located_poses_test {
namespace {

using namespace test_flights;
using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

std::vector<LocatedPose> found_exactly(const geometry::Trajectory& local) {
  std::vector<LocatedPose> poses;
  const geometry::Trajectory map = geometry::transformed(T_local_map().inverse(), local);
  for (std::size_t k = 0; k < local.size(); ++k) {
    poses.push_back({map.poses[k].T_local_camera, local.poses[k].T_local_camera});
    poses.back().information.diagonal() << 1e4, 1e4, 1e4, 1e6, 1e6, 1e6;  // sigmas of a centimetre and a milliradian
  }
  return poses;
}

TEST(LocatedPoses, AStraightPathGivesItAllThroughItsTurns) {
  const LocatedPosesFit fit = fit_located_poses(found_exactly(straight_path()), Sim3());
  EXPECT_EQ(fit.inliers, 20U);
  EXPECT_LT((fit.estimate.T_target_source.matrix() - T_local_map().matrix()).norm(), 1e-6);
}

TEST(LocatedPoses, PosesThatWereFoundElsewhereAreTold) {
  std::vector<LocatedPose> poses = found_exactly(curved_path());
  for (const std::size_t k : {2U, 7U, 11U, 15U, 16U, 20U}) poses[k].T_local_camera.translation += Vec3(1.5, -0.7, 0.4);
  const LocatedPosesFit fit = fit_located_poses(poses, Sim3());
  EXPECT_EQ(fit.inliers, poses.size() - 6);
  EXPECT_FALSE(fit.is_inlier[7]);
  EXPECT_NEAR(fit.distances_m[7], Vec3(1.5, -0.7, 0.4).norm(), 0.05);
  EXPECT_LT((fit.estimate.T_target_source * Vec3(1, 1, 1) - T_local_map() * Vec3(1, 1, 1)).norm(), 0.02);
}

TEST(LocatedPoses, NoiseIsMeasured) {
  std::vector<LocatedPose> poses = found_exactly(curved_path());
  std::mt19937_64 random(4);
  std::normal_distribution<double> normal;
  for (LocatedPose& pose : poses) {  // errors five times the stated sigma
    geometry::Vec6 twist;
    for (int k = 0; k < 6; ++k) twist[k] = 5.0 * normal(random) * (k < 3 ? 1e-2 : 1e-3);
    pose.T_local_camera = pose.T_local_camera * SE3::exp(twist);
  }
  const LocatedPosesFit fit = fit_located_poses(poses, T_local_map());
  EXPECT_NEAR(fit.noise, 5.0, 1.5);
  EXPECT_EQ(fit.inliers, poses.size());
}

TEST(LocatedPoses, OnePoseIsTooFew) {
  EXPECT_THAT([&] { fit_located_poses({found_exactly(curved_path()).front()}, Sim3()); },
              ThrowsMessage<InputError>(HasSubstr("located poses: at least two are needed")));
}

}  // namespace
}  // namespace tileflight::registration::located_poses_test
