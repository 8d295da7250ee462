#include "tileflight/world/ground_truth/point_cells.h"

#include <gmock/gmock.h>

#include <random>
#include <set>

namespace tileflight::ground_truth::point_cells_test {
namespace {

using geometry::Cell;
using geometry::PointCloud;
using geometry::Vec3;
using geometry::VoxelGrid;

VoxelGrid grid() {
  VoxelGrid out;
  out.origin = Vec3(-2, 10, 0.5);
  out.edge_m = 0.5;
  out.dims = {4, 3, 2};
  return out;
}

TEST(PointCells, APointLiesInTheCellWhoseIntervalHoldsIt) {
  VoxelGrid g = grid();
  g.occupied = {{0, 0, 0}};
  PointCloud cloud;
  cloud.positions = {Vec3(-2, 10, 0.5),      Vec3(-1.5, 10, 0.5),  // on a border: the upper cell
                     Vec3(0, 11.5, 1.5),                           // the last corner: the last cell
                     Vec3(0.01, 10, 0.5),    Vec3(-2, 9.99, 0.5),  // outside
                     Vec3(-1.2, 10.7, 1.01), Vec3(-1.1, 10.8, 1.02)};
  mark_occupied(cloud, g);
  EXPECT_THAT(g.occupied, ::testing::ElementsAre(Cell{0, 0, 0}, Cell{1, 0, 0}, Cell{1, 1, 1}, Cell{3, 2, 1}));
}

/// Brute force: tests each cell's box.
TEST(PointCells, SameAsAskingEveryCell) {
  std::mt19937 random(4);
  std::uniform_real_distribution<double> spread(-1, 2.5);
  PointCloud cloud;
  for (int i = 0; i < 600; ++i)
    cloud.positions.push_back(grid().origin + Vec3(spread(random), spread(random), spread(random)));
  VoxelGrid g = grid();
  mark_occupied(cloud, g);
  std::set<Cell> expected;
  for (int x = 0; x < 4; ++x) {
    for (int y = 0; y < 3; ++y) {
      for (int z = 0; z < 2; ++z) {
        const Vec3 corner = g.origin + 0.5 * Vec3(x, y, z);
        for (const Vec3& p : cloud.positions) {
          const bool inside = (p.array() >= corner.array()).all() && (p.array() < corner.array() + 0.5).all();
          if (inside) expected.insert({x, y, z});
        }
      }
    }
  }
  EXPECT_THAT(g.occupied, ::testing::ElementsAreArray(expected));
  EXPECT_GT(expected.size(), 5U);
}

TEST(PointCells, OnlyWhatLiesInTheBox) {
  PointCloud with_normals;
  with_normals.positions = {Vec3(0, 0, 0), Vec3(5, 0, 0)};
  with_normals.normals = {Eigen::Vector3f(1, 0, 0), Eigen::Vector3f(0, 1, 0)};
  PointCloud without;
  without.positions = {Vec3(1, 1, 1)};
  const PointCloud points = points_in_box({with_normals, without}, geometry::Box3(Vec3(0, 0, 0), Vec3(1, 1, 1)));
  EXPECT_THAT(points.positions, ::testing::ElementsAre(Vec3(0, 0, 0), Vec3(1, 1, 1)));
  EXPECT_THAT(points.normals, ::testing::ElementsAre(Eigen::Vector3f(1, 0, 0), Eigen::Vector3f(0, 0, 0)));
}

}  // namespace
}  // namespace tileflight::ground_truth::point_cells_test
