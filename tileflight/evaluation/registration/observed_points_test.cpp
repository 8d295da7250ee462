#include "tileflight/evaluation/registration/observed_points.h"

#include <gtest/gtest.h>

namespace tileflight::registration::observed_points_test {
namespace {

geometry::Trajectory two_keyframes() {
  geometry::Trajectory keyframes;
  keyframes.poses.push_back({0.0, geometry::SE3()});
  keyframes.poses.push_back({1.0, geometry::SE3(Eigen::Quaterniond::Identity(), {1.0, 0.0, 0.0})});
  return keyframes;
}

geometry::PointCloud three_points() {
  geometry::PointCloud map;
  map.positions = {{0, 0, 2}, {1, 0, 4}, {0, 0, 5}};
  map.scalars["keyframe"] = {0, 1, 0};
  map.scalars["inverse_depth_variance"] = {1e-4F, 1e-6F, 0.0F};
  return map;
}

TEST(ObservedPoints, ViewpointsAreTheKeyframesAndSigmasAreOfTheDistance) {
  const ObservedPoints points = make_observed_points(three_points(), two_keyframes());
  ASSERT_EQ(points.size(), 3U);
  EXPECT_EQ(points.keyframe, (std::vector<std::size_t>{0, 1, 0}));
  EXPECT_EQ(points.viewpoints[1], geometry::Vec3(1, 0, 0));
  // rho = 1/2 with sigma 0.01: two per cent; rho = 1/4 with sigma 0.001: 0.4 %.
  EXPECT_NEAR(points.distance_sigma[0], 0.02, 1e-6);
  EXPECT_NEAR(points.distance_sigma[1], 0.004, 1e-6);
  EXPECT_EQ(points.distance_sigma[2], 0.0);
}

TEST(ObservedPoints, KeyframesThatAreNotThereLeaveViewpointsOut) {
  geometry::PointCloud map = three_points();
  map.scalars["keyframe"][1] = 2;
  EXPECT_FALSE(make_observed_points(map, two_keyframes()).has_viewpoints());
  map.scalars.erase("keyframe");
  EXPECT_FALSE(make_observed_points(map, two_keyframes()).has_viewpoints());
  EXPECT_EQ(make_observed_points(map, two_keyframes()).size(), 3U);
}

TEST(ObservedPoints, ThinningKeepsWhatBelongsTogether) {
  const ObservedPoints few = subsample(make_observed_points(three_points(), two_keyframes()), 2);
  ASSERT_EQ(few.size(), 2U);
  EXPECT_EQ(few.positions[1], geometry::Vec3(0, 0, 5));
  EXPECT_EQ(few.keyframe, (std::vector<std::size_t>{0, 0}));
  EXPECT_EQ(few.viewpoints.size(), 2U);
  EXPECT_EQ(few.distance_sigma.size(), 2U);
}

}  // namespace
}  // namespace tileflight::registration::observed_points_test
