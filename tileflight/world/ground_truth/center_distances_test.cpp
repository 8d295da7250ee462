#include "tileflight/world/ground_truth/center_distances.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <random>
#include <set>

#include "tileflight/core/base/input_error.h"
#include "tileflight/core/geometry/nearest.h"

namespace tileflight::ground_truth::center_distances_test {
namespace {

using geometry::Vec3;
using geometry::VoxelGrid;
using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

/// Random cells; some isolated, some adjacent.
VoxelGrid some_grid(std::uint64_t seed) {
  std::mt19937_64 random(seed);
  VoxelGrid grid{.origin = {-3.7, 12.4, 100.1}, .edge_m = 0.7, .dims = {40, 30, 20}};
  std::set<geometry::Cell> cells;
  for (int k = 0; k < 1500; ++k) {
    const auto below = [&](std::int32_t n) { return static_cast<std::int32_t>(random() % static_cast<unsigned>(n)); };
    const geometry::Cell cell{below(20), below(30), below(10)};
    cells.insert(cell);
    cells.insert({cell.x + 1, cell.y, cell.z});
  }
  grid.occupied.assign(cells.begin(), cells.end());
  return grid;
}

TEST(CenterDistances, AreThoseOfASearchAmongAllCentres) {
  const VoxelGrid grid = some_grid(1);
  const geometry::NearestIndex index(geometry::cell_centers(grid).positions);
  std::mt19937_64 random(2);
  std::uniform_real_distribution<double> along(-0.3, 1.3);
  std::vector<Vec3> points;
  for (int k = 0; k < 20000; ++k)  // within, beside and far from the cells
    points.push_back(grid.origin + 0.7 * Vec3(40 * along(random), 30 * along(random), 20 * along(random)));
  for (const geometry::Cell& c : grid.occupied) {  // at corners, edges and faces
    points.push_back(grid.origin + 0.7 * Vec3(c.x, c.y, c.z));
    points.push_back(grid.center(c) + Vec3(0.35, 0, 0));
  }
  points.push_back({1e12, -1e12, 0});
  const std::vector<double> distances = center_distances(points, grid);
  ASSERT_EQ(distances.size(), points.size());
  for (std::size_t i = 0; i < points.size(); ++i) {
    const double expected = index.nearest(points[i])->distance_m;
    EXPECT_NEAR(distances[i], expected, 1e-12 * std::max(1.0, expected)) << points[i].transpose();
  }
}

TEST(CenterDistances, InTheOwnCellTheyAreEqualToTheBit) {
  const VoxelGrid grid = some_grid(3);
  const geometry::NearestIndex index(geometry::cell_centers(grid).positions);
  std::mt19937_64 random(4);
  std::uniform_real_distribution<double> along(-0.49, 0.49);
  std::vector<Vec3> points;
  for (const geometry::Cell& c : grid.occupied)
    points.push_back(grid.center(c) + 0.7 * Vec3(along(random), along(random), along(random)));
  const std::vector<double> distances = center_distances(points, grid);
  ASSERT_EQ(distances.size(), points.size());
  for (std::size_t i = 0; i < points.size(); ++i) EXPECT_EQ(distances[i], index.nearest(points[i])->distance_m);
}

TEST(CenterDistances, NoCellIsRefused) {
  EXPECT_THAT(
      [&] {
        center_distances({Vec3(0, 0, 0)}, VoxelGrid{.dims = {1, 1, 1}});
      },
      ThrowsMessage<InputError>(HasSubstr("voxels: no voxel is occupied")));
  EXPECT_TRUE(center_distances({}, some_grid(5)).empty());
}

}  // namespace
}  // namespace tileflight::ground_truth::center_distances_test
