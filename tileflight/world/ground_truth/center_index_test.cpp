#include "tileflight/world/ground_truth/center_index.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>
#include <random>
#include <set>

#include "tileflight/core/base/input_error.h"
#include "tileflight/core/geometry/nearest.h"
#include "tileflight/core/geometry/voxel_grid.h"

namespace tileflight::ground_truth::center_index_test {
namespace {

using geometry::Vec3;

constexpr double kAnywhere = std::numeric_limits<double>::infinity();

/// A wavy layer of cells far from the frame's origin, with gaps.
std::vector<Vec3> layer_of_centers(double edge_m) {
  geometry::VoxelGrid grid{Vec3(512.3, -871.9, 2900.4), edge_m, {60, 50, 20}, {}};
  for (std::int32_t x = 0; x < 60; ++x) {
    for (std::int32_t y = 0; y < 50; ++y) {
      if ((x * 7 + y * 3) % 11 == 0 || (x > 20 && x < 28)) continue;
      grid.occupied.push_back({x, y, 10 + (x * x + 3 * y) % 5});
    }
  }
  return geometry::cell_centers(grid).positions;
}

TEST(CenterIndex, FindsWhatTheTreeFinds) {
  std::mt19937 random(1);
  for (const double edge_m : {1.0, 0.37}) {
    const std::vector<Vec3> centers = layer_of_centers(edge_m);
    const CenterIndex index(centers, edge_m);
    const geometry::NearestIndex tree(centers);
    std::uniform_real_distribution<double> x(-5.0, 65.0), y(-5.0, 55.0), z(-5.0, 25.0);
    std::vector<Vec3> queries{Vec3(1e9, 0, 0), Vec3(0, -1e12, 5)};
    for (int i = 0; i < 20000; ++i)
      queries.emplace_back(Vec3(512.3, -871.9, 2900.4) + edge_m * Vec3(x(random), y(random), z(random)));
    // On centres, and where cells meet: several centres are equally near.
    for (std::size_t i = 0; i < centers.size(); i += 7) {
      queries.push_back(centers[i]);
      queries.emplace_back(centers[i] + Vec3::Constant(0.5 * edge_m));
      queries.emplace_back(centers[i] + 0.5 * edge_m * Vec3::UnitX());
    }
    for (const Vec3& query : queries) {
      for (const double radius_m : {kAnywhere, 0.6 * edge_m}) {
        const auto expected = tree.nearest(query, radius_m);
        const auto found = index.nearest(query, radius_m);
        ASSERT_EQ(found.has_value(), expected.has_value());
        if (found) {
          ASSERT_EQ(*found, expected->distance_m);
        }
      }
    }
  }
}

TEST(CenterIndex, TakesPointsOnNoGrid) {
  std::vector<Vec3> centers = layer_of_centers(1.0);
  centers[100].y() += 0.3;
  const CenterIndex index(centers, 1.0);
  const geometry::NearestIndex tree(centers);
  for (const Vec3& query : {Vec3(530.0, -860.0, 2905.0), Vec3(centers[100] + Vec3(0.2, 0, 0))})
    EXPECT_EQ(index.nearest(query, kAnywhere), tree.nearest(query)->distance_m);
  const std::vector<Vec3> none;
  EXPECT_EQ(CenterIndex(none, 1.0).nearest(Vec3::Zero(), kAnywhere), std::nullopt);
}

}  // namespace
}  // namespace tileflight::ground_truth::center_index_test

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
