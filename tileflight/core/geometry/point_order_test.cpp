#include "tileflight/core/geometry/point_order.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <random>

namespace tileflight::geometry::morton_order_test {
namespace {

std::vector<Vec3> scattered(std::size_t n, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  std::uniform_real_distribution<double> coordinate(-40.0, 60.0);
  std::vector<Vec3> points;
  for (std::size_t k = 0; k < n; ++k) points.push_back({coordinate(random), coordinate(random), coordinate(random)});
  return points;
}

double way_m(const std::vector<Vec3>& points, const std::vector<std::uint32_t>& order) {
  double way = 0.0;
  for (std::size_t k = 1; k < order.size(); ++k) way += (points[order[k]] - points[order[k - 1]]).norm();
  return way;
}

TEST(MortonOrder, HoldsEachPointOnceAndKeepsNeighboursTogether) {
  const auto points = scattered(5000, 1);
  auto order = morton_order(points);
  std::vector<std::uint32_t> as_given(points.size());
  std::iota(as_given.begin(), as_given.end(), 0u);
  EXPECT_LT(way_m(points, order), 0.15 * way_m(points, as_given));
  std::sort(order.begin(), order.end());
  EXPECT_EQ(order, as_given);
}

TEST(MortonOrder, OneFarPointLeavesTheOthersInOrder) {
  auto points = scattered(5000, 4);
  const double way_alone_m = way_m(points, morton_order(points));
  points.push_back({1e6, -1e6, 0});
  auto order = morton_order(points);
  std::erase(order, 5000u);
  EXPECT_LT(way_m(points, order), 1.05 * way_alone_m);
}

TEST(MortonOrder, OfOnePlaceAndOfNothing) {
  EXPECT_TRUE(morton_order({}).empty());
  EXPECT_EQ(morton_order({Vec3(1, 2, 3), Vec3(1, 2, 3)}), (std::vector<std::uint32_t>{0, 1})) << "all in one place";
}

TEST(EvenlyChosen, EachHasAboutAsManyPointsAroundIt) {
  const auto points = scattered(20000, 2);
  auto chosen = sample_evenly(points, 500);
  ASSERT_EQ(chosen.size(), 500u);
  std::ranges::sort(chosen);
  EXPECT_EQ(std::ranges::adjacent_find(chosen), chosen.end()) << "none twice";
  // Cubes of 25 m hold their share of the chosen points more exactly than with random selection (variance 7.7).
  std::vector<double> among_all(64), among_chosen(64);
  const auto cube = [](const Vec3& p) {
    const Vec3 c = ((p + Vec3::Constant(40.0)) / 25.0).array().floor();
    return static_cast<std::size_t>(c.x() * 16 + c.y() * 4 + c.z());
  };
  for (const Vec3& p : points) among_all[cube(p)] += 1.0;
  for (const std::uint32_t i : chosen) among_chosen[cube(points[i])] += 1.0;
  double squares = 0.0;
  for (std::size_t k = 0; k < 64; ++k) squares += std::pow(among_chosen[k] - among_all[k] / 40.0, 2);
  EXPECT_LT(squares / 64.0, 3.0);
}

TEST(EvenlyChosen, AllOfFew) {
  EXPECT_EQ(sample_evenly(scattered(3, 3), 5), (std::vector<std::uint32_t>{0, 1, 2}));
  EXPECT_TRUE(sample_evenly(scattered(3, 3), 0).empty());
  EXPECT_TRUE(sample_evenly({}, 5).empty());
}

TEST(MortonOrder, WalksACubeCornerByCorner) {
  std::vector<Vec3> corners;
  for (int z = 0; z < 2; ++z)
    for (int y = 0; y < 2; ++y)
      for (int x = 0; x < 2; ++x) corners.push_back({x * 1.0, y * 1.0, z * 1.0});
  const std::vector<Vec3> shuffled = {corners[5], corners[0], corners[7], corners[2],
                                      corners[1], corners[6], corners[3], corners[4]};
  const std::vector<std::uint32_t> x_fastest_z_slowest{1, 4, 3, 6, 7, 0, 5, 2};
  EXPECT_EQ(morton_order(shuffled), x_fastest_z_slowest);
  EXPECT_EQ(morton_order(shuffled, kCoarseMortonCells), x_fastest_z_slowest);
}

}  // namespace
}  // namespace tileflight::geometry::morton_order_test

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
