#include "tileflight/alignment/spatial_order.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <numeric>
#include <random>

namespace tileflight::alignment {
namespace {

using geometry::Vec3;

TEST(SpatialOrder, IsAPermutation) {
  std::mt19937_64 random(1);
  std::uniform_real_distribution<double> coordinate(-50.0, 50.0);
  std::vector<Vec3> points(1000);
  for (Vec3& p : points) p = {coordinate(random), coordinate(random), coordinate(random)};
  auto order = spatial_order(points);
  std::sort(order.begin(), order.end());
  std::vector<std::uint32_t> all(1000);
  std::iota(all.begin(), all.end(), 0u);
  EXPECT_EQ(order, all);
}

TEST(SpatialOrder, WalksACubeCornerByCorner) {
  std::vector<Vec3> corners;
  for (int z = 0; z < 2; ++z) {
    for (int y = 0; y < 2; ++y) {
      for (int x = 0; x < 2; ++x) corners.push_back({x * 1.0, y * 1.0, z * 1.0});
    }
  }
  std::vector<Vec3> shuffled = {corners[5], corners[0], corners[7], corners[2],
                                corners[1], corners[6], corners[3], corners[4]};
  EXPECT_EQ(spatial_order(shuffled), (std::vector<std::uint32_t>{1, 4, 3, 6, 7, 0, 5, 2})) << "x fastest, z slowest";
}

TEST(SpatialOrder, EqualPointsKeepTheirOrder) {
  EXPECT_EQ(spatial_order(std::vector<Vec3>(5, Vec3(1, 2, 3))), (std::vector<std::uint32_t>{0, 1, 2, 3, 4}));
  EXPECT_TRUE(spatial_order({}).empty());
}

TEST(SpatialOrder, NeighboursAreNear) {
  std::vector<Vec3> grid;
  for (int i = 0; i < 64; ++i) {
    for (int j = 0; j < 64; ++j) grid.push_back({((i * 37) % 64) * 1.0, ((j * 29) % 64) * 1.0, 0.0});
  }
  const auto order = spatial_order(grid);
  double path = 0.0;
  for (std::size_t k = 1; k < order.size(); ++k) path += (grid[order[k]] - grid[order[k - 1]]).norm();
  EXPECT_LT(path / static_cast<double>(order.size()), 2.5) << "metres from one to the next, where the grid's step is 1";
}

}  // namespace
}  // namespace tileflight::alignment
