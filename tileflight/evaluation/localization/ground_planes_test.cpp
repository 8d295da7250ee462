#include "tileflight/evaluation/localization/ground_planes.h"

#include <gtest/gtest.h>

#include <random>

namespace tileflight::localization::ground_planes_test {
namespace {

using geometry::SE3;
using geometry::Vec3;

const Vec3 kUp = Vec3(0.3, -0.5, 0.8).normalized();

/// Level ground with noise and objects on it, in a tilted frame; cameras above.
struct Map {
  std::vector<Vec3> points;
  std::vector<SE3> cameras;

  explicit Map(double wall_share) {
    const Eigen::Quaterniond lean = Eigen::Quaterniond::FromTwoVectors(Vec3::UnitZ(), kUp);
    std::mt19937_64 random(2);
    std::uniform_real_distribution<double> unit(-1.0, 1.0);
    for (int k = 0; k < 2000; ++k) {
      Vec3 p(10.0 * unit(random), 10.0 * unit(random), 0.02 * unit(random));
      if (k < wall_share * 2000) p = Vec3(4.0 + 0.02 * unit(random), p.y(), 3.0 + 3.0 * unit(random));
      points.push_back(lean * p);
    }
    for (int k = -4; k <= 4; ++k) cameras.emplace_back(Eigen::Quaterniond::Identity(), lean * Vec3(2.0 * k, 0.0, 9.0));
  }
};

TEST(GroundPlanes, IsThePlanesNormalToTheCameras) {
  const Map map(0.3);
  const auto planes = find_ground_planes(map.points, map.cameras);
  ASSERT_FALSE(planes.empty());
  EXPECT_GT(planes.front().up.dot(kUp), 0.9999);
  EXPECT_NEAR(planes.front().share, 0.7, 0.02);
}

TEST(GroundPlanes, AWallBetweenTheCamerasIsNoGround) {
  const Map map(0.7);  // most points are on a wall with cameras on both sides of its plane
  const auto planes = find_ground_planes(map.points, map.cameras);
  ASSERT_FALSE(planes.empty());
  EXPECT_GT(planes.front().up.dot(kUp), 0.999);
}

TEST(GroundPlanes, NoneWithoutPointsOrCameras) {
  const Map map(0.0);
  EXPECT_TRUE(find_ground_planes({}, map.cameras).empty());
  EXPECT_TRUE(find_ground_planes(map.points, {}).empty());
  EXPECT_TRUE(find_ground_planes({Vec3(0, 0, 0), Vec3(1, 0, 0)}, map.cameras).empty());
  const std::vector<Vec3> same(100, Vec3(1, 2, 3));
  EXPECT_TRUE(find_ground_planes(same, map.cameras).empty());
}

TEST(GroundPlanes, IsTheSameEachTime) {
  const Map map(0.3);
  const auto a = find_ground_planes(map.points, map.cameras), b = find_ground_planes(map.points, map.cameras);
  ASSERT_EQ(a.size(), b.size());
  for (std::size_t k = 0; k < a.size(); ++k) EXPECT_EQ(a[k].up, b[k].up);
}

}  // namespace
}  // namespace tileflight::localization::ground_planes_test
