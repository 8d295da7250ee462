#include "tileflight/core/geometry/position_order.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <numeric>
#include <random>

namespace tileflight::geometry::position_order_test {
namespace {

PointCloud random_cloud(std::size_t count) {
  std::mt19937 random(5);
  std::uniform_real_distribution<double> position(-40.0, 300.0);
  std::uniform_real_distribution<float> normal(-1.0F, 1.0F);
  PointCloud cloud;
  for (std::size_t i = 0; i < count; ++i) {
    // Every tenth point repeats the place of another, with its own normal.
    cloud.positions.push_back(i % 10 == 9 ? cloud.positions[i / 2] : Vec3(position(random), position(random), 3.0));
    cloud.normals.emplace_back(normal(random), normal(random), normal(random));
  }
  return cloud;
}

TEST(SortByPosition, TheSamePointsInAnySequenceAreTheSameCloud) {
  PointCloud a = random_cloud(5000);
  std::vector<std::size_t> shuffled(a.size());
  std::iota(shuffled.begin(), shuffled.end(), std::size_t{0});
  std::shuffle(shuffled.begin(), shuffled.end(), std::mt19937(7));
  PointCloud b;
  for (const std::size_t i : shuffled) {
    b.positions.push_back(a.positions[i]);
    b.normals.push_back(a.normals[i]);
  }
  sort_by_position(a);
  sort_by_position(b);
  EXPECT_EQ(a.positions, b.positions);
  EXPECT_EQ(a.normals, b.normals);
}

TEST(SortByPosition, KeepsEveryPointWithItsNormalAndBringsNeighboursTogether) {
  const PointCloud before = random_cloud(5000);
  PointCloud after = before;
  sort_by_position(after);
  const auto sum = [](const PointCloud& cloud) {
    double total = 0.0;
    for (std::size_t i = 0; i < cloud.size(); ++i) total += cloud.positions[i].dot(cloud.normals[i].cast<double>());
    return total;
  };
  EXPECT_NEAR(sum(after), sum(before), 1e-6);
  const auto path_m = [](const PointCloud& cloud) {
    double length = 0.0;
    for (std::size_t i = 1; i < cloud.size(); ++i) length += (cloud.positions[i] - cloud.positions[i - 1]).norm();
    return length;
  };
  EXPECT_LT(path_m(after), 0.1 * path_m(before));
}

TEST(SortByPosition, TakesCloudsWithoutNormalsAndFarPoints) {
  PointCloud cloud;
  cloud.positions = {{1e9, 0, 0}, {-1e9, 5, 0}, {0, 0, 0}, {-1e9, 4, 0}};
  sort_by_position(cloud);
  EXPECT_EQ(cloud.positions, (std::vector<Vec3>{{-1e9, 4, 0}, {-1e9, 5, 0}, {0, 0, 0}, {1e9, 0, 0}}));
  PointCloud none;
  sort_by_position(none);
  EXPECT_TRUE(none.empty());
}

}  // namespace
}  // namespace tileflight::geometry::position_order_test
