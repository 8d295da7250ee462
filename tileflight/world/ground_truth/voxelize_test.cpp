#include "tileflight/world/ground_truth/voxelize.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <set>

#include "tests/temporary_folder.h"
#include "tileflight/core/base/files.h"
#include "tileflight/core/base/input_error.h"

namespace tileflight::ground_truth::voxelize_test {
namespace {

using geometry::Box3;
using geometry::Cell;
using geometry::TriangleMesh;
using geometry::Vec3;
using geometry::VoxelGrid;

using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

/// Clips a convex polygon to the side of a plane where sign * (p[axis] - at) >= 0 (Sutherland and Hodgman 1974).
std::vector<Vec3> clipped_polygon(const std::vector<Vec3>& polygon, int axis, double at, double sign) {
  const auto depth = [&](const Vec3& p) { return sign * (p[axis] - at) + 1e-12; };
  std::vector<Vec3> kept;
  for (std::size_t i = 0; i < polygon.size(); ++i) {
    const Vec3& p = polygon[i];
    const Vec3& q = polygon[(i + 1) % polygon.size()];
    if (depth(p) >= 0.0) kept.push_back(p);
    if ((depth(p) >= 0.0) != (depth(q) >= 0.0)) kept.push_back(p + depth(p) / (depth(p) - depth(q)) * (q - p));
  }
  return kept;
}

/// Independent test whether a triangle touches a cell: whether anything remains after clipping by the cell's six faces.
bool touches(const TriangleMesh& mesh, const geometry::Triangle& t, const VoxelGrid& grid, const Cell& cell) {
  std::vector<Vec3> polygon = {mesh.vertices[t[0]], mesh.vertices[t[1]], mesh.vertices[t[2]]};
  const Vec3 low = grid.origin + grid.edge_m * Vec3(cell.x, cell.y, cell.z);
  for (int axis = 0; axis < 3; ++axis) {
    polygon = clipped_polygon(polygon, axis, low[axis], 1.0);
    polygon = clipped_polygon(polygon, axis, low[axis] + grid.edge_m, -1.0);
  }
  return !polygon.empty();
}

/// All pairs of cells and triangles.
std::vector<Cell> brute_force(const TriangleMesh& mesh, const VoxelGrid& grid) {
  std::vector<Cell> occupied;
  for (std::int32_t x = 0; x < grid.dims[0]; ++x) {
    for (std::int32_t y = 0; y < grid.dims[1]; ++y) {
      for (std::int32_t z = 0; z < grid.dims[2]; ++z) {
        const Cell cell{x, y, z};
        const auto touched = [&](const geometry::Triangle& t) { return touches(mesh, t, grid, cell); };
        if (std::any_of(mesh.triangles.begin(), mesh.triangles.end(), touched)) occupied.push_back(cell);
      }
    }
  }
  return occupied;
}

void add_triangle(TriangleMesh& mesh, const Vec3& a, const Vec3& b, const Vec3& c) {
  const auto first = static_cast<std::uint32_t>(mesh.vertices.size());
  for (const Vec3& v : {a, b, c}) mesh.vertices.push_back(v);
  mesh.triangles.push_back({first, first + 1, first + 2});
}

void add_rectangle(TriangleMesh& mesh, const Vec3& corner, const Vec3& side_a, const Vec3& side_b) {
  add_triangle(mesh, corner, corner + side_a, corner + side_a + side_b);
  add_triangle(mesh, corner, corner + side_a + side_b, corner + side_b);
}

Box3 cube_box(double side_m) { return {Vec3::Zero(), Vec3::Constant(side_m)}; }

void expect_brute_force(const TriangleMesh& mesh, const Box3& box, double edge_m) {
  const VoxelGrid grid = voxelize(mesh, box, edge_m);
  EXPECT_EQ(grid.occupied, brute_force(mesh, grid));
}

/// Triangles about a place in the box, of this size; some reach out of it.
TriangleMesh random_triangles(int count, unsigned seed, double size_m, const Box3& box) {
  std::mt19937 random(seed);
  std::normal_distribution<double> normal(0.0, size_m);
  std::uniform_real_distribution<double> uniform(-0.1, 1.1);
  TriangleMesh mesh;
  const auto near = [&](const Vec3& p) { return Vec3(p + Vec3(normal(random), normal(random), normal(random))); };
  for (int i = 0; i < count; ++i) {
    const Vec3 center = box.min() + Vec3(uniform(random), uniform(random), uniform(random)).cwiseProduct(box.sizes());
    add_triangle(mesh, near(center), near(center), near(center));
  }
  return mesh;
}

TEST(GridDims, CoverTheWholeBox) {
  const auto dims = [](double size_m, double edge_m) {
    return grid_dims({geometry::Vec3::Zero(), geometry::Vec3::Constant(size_m)}, edge_m)[2];
  };
  EXPECT_EQ(dims(10.0, 1.0), 10);
  EXPECT_EQ(dims(9.0, 0.3), 30);
  EXPECT_EQ(dims(250.0 + 1e-10, 1.0), 250);
  EXPECT_EQ(dims(10.0014, 1.0), 11);
  EXPECT_EQ(dims(10.4, 1.0), 11);
  EXPECT_EQ(dims(0.2, 1.0), 1);
}

TEST(Voxelize, EqualsBruteForceOnTrianglesOfEverySize) {
  for (const double size_m : {0.02, 0.3, 1.0, 4.0, 50.0}) {
    for (unsigned seed = 0; seed < 40; ++seed) {
      // A few at a time, so that no other triangle hides a wrong cell.
      const Box3 box(Vec3(-3, 2, 2885), Vec3(3, 6.5, 2889));
      expect_brute_force(random_triangles(3, seed, size_m, box), box, 0.5);
    }
  }
}

TEST(Voxelize, EqualsBruteForceOnCornersThatLieOnTheGrid) {
  std::mt19937 random(9);
  const auto quarter = [&] { return 0.25 * static_cast<double>(random() % 33); };
  for (int i = 0; i < 400; ++i) {
    TriangleMesh mesh;
    const auto corner = [&] { return Vec3(quarter(), quarter(), quarter()); };
    add_triangle(mesh, corner(), corner(), corner());
    expect_brute_force(mesh, cube_box(8.0), 1.0);
  }
}

TEST(Voxelize, EqualsBruteForceOnNeedlesAndSlivers) {
  std::mt19937 random(10);
  std::uniform_real_distribution<double> uniform(-1.0, 9.0);
  for (int i = 0; i < 300; ++i) {
    TriangleMesh mesh;
    const auto corner = [&] { return Vec3(uniform(random), uniform(random), uniform(random)); };
    const Vec3 a = corner(), b = corner();
    const double thin = std::pow(10.0, -3.0 * (i % 7));
    add_triangle(mesh, a, b, a + 0.4 * (b - a) + thin * 0.1 * corner());
    expect_brute_force(mesh, cube_box(8.0), 1.0);
  }
}

TEST(Voxelize, EqualsBruteForceOnAxisAlignedTriangles) {
  std::mt19937 random(11);
  std::uniform_real_distribution<double> uniform(-1.0, 9.0);
  for (int i = 0; i < 200; ++i) {
    TriangleMesh mesh;
    Vec3 corners[3];
    for (Vec3& c : corners) c = Vec3(uniform(random), uniform(random), uniform(random));
    const int axis = i % 3;
    for (Vec3& c : corners) c[axis] = i % 2 == 0 ? 4.0 : 4.3;
    add_triangle(mesh, corners[0], corners[1], corners[2]);
    expect_brute_force(mesh, cube_box(8.0), 1.0);
  }
}

TEST(Voxelize, TrianglesWithoutAreaAreSegmentsAndPoints) {
  TriangleMesh mesh;
  add_triangle(mesh, Vec3(0.5, 0.5, 0.5), Vec3(7.2, 5.1, 3.3), Vec3(0.5, 0.5, 0.5));
  add_triangle(mesh, Vec3(1.5, 6.5, 7.5), Vec3(1.5, 6.5, 7.5), Vec3(1.5, 6.5, 7.5));
  add_triangle(mesh, Vec3(7.5, 0.5, 0.5), Vec3(7.5, 4.5, 0.5), Vec3(7.5, 2.5, 0.5));
  expect_brute_force(mesh, cube_box(8.0), 1.0);
}

TEST(Voxelize, AFaceBetweenTwoCellsTouchesBoth) {
  TriangleMesh mesh;
  add_triangle(mesh, Vec3(0.2, 0.2, 0.9), Vec3(0.25, 0.2, 0.9), Vec3(0.2, 0.25, 0.9));
  // 0.9 is three times 0.3 only up to rounding; the face between the third and the fourth cell belongs to both all the
  // same.
  const VoxelGrid grid = voxelize(mesh, cube_box(1.8), 0.3);
  EXPECT_EQ(grid.occupied, (std::vector<Cell>{{0, 0, 2}, {0, 0, 3}}));
}

TEST(Voxelize, CornersFarOutsideTheBox) {
  TriangleMesh mesh;
  add_triangle(mesh, Vec3(-1e9, -1e9, 3.3), Vec3(2e9, -1e9, 3.3), Vec3(0, 2e9, 3.3));
  const VoxelGrid grid = voxelize(mesh, cube_box(8.0), 1.0);
  EXPECT_EQ(grid.occupied.size(), 64U);
  for (const Cell& cell : grid.occupied) EXPECT_EQ(cell.z, 3);
}

TEST(Voxelize, SameCellsForAnyNumberOfThreadsAndOrderOfTriangles) {
  const Box3 box = cube_box(60.0);
  TriangleMesh mesh = random_triangles(40000, 3, 0.6, box);
  const VoxelGrid parallel = voxelize(mesh, box, 0.4);
  EXPECT_TRUE(std::is_sorted(parallel.occupied.begin(), parallel.occupied.end()));
  EXPECT_EQ(std::adjacent_find(parallel.occupied.begin(), parallel.occupied.end()), parallel.occupied.end());
  std::shuffle(mesh.triangles.begin(), mesh.triangles.end(), std::mt19937(1));
  const tbb::global_control one(tbb::global_control::max_allowed_parallelism, 1);
  EXPECT_EQ(voxelize(mesh, box, 0.4).occupied, parallel.occupied);
}

TEST(Voxelize, ReportsProgressToTheEnd) {
  const TriangleMesh mesh = random_triangles(30000, 4, 0.1, cube_box(10.0));
  std::int64_t last = 0;
  voxelize(mesh, cube_box(10.0), 1.0, [&](std::int64_t done, std::int64_t total, std::string_view) {
    EXPECT_GT(done, last);
    EXPECT_EQ(total, 30000);
    last = done;
  });
  EXPECT_EQ(last, 30000);
}

// Known faults of AirSim's simCreateVoxelGrid, one test each.

TEST(AirSimFaults, ScaleOfTheFileIsTheLongestSideNotItsInverse) {
  const tests::TemporaryFolder folder;
  TriangleMesh mesh;
  add_rectangle(mesh, Vec3(0, 0, 1.1), Vec3(100, 0, 0), Vec3(0, 100, 0));
  write_binvox(folder / "v.binvox", voxelize(mesh, cube_box(100.0), 0.5));
  EXPECT_THAT(base::read_text(folder / "v.binvox"), HasSubstr("\nscale 100\n"));
  EXPECT_DOUBLE_EQ(geometry::read_binvox(folder / "v.binvox").edge_m, 0.5);
}

TEST(AirSimFaults, IndicesBeyondTwoToThe24AreExact) {
  // 300 x 300 x 300 = 27 million cells: a float counts by twos and fours there. Every second cell of the last row.
  const tests::TemporaryFolder folder;
  TriangleMesh mesh;
  std::vector<Cell> expected;
  for (std::int32_t z = 1; z < 300; z += 2) {
    const Vec3 center(299.5, 299.5, z + 0.5);
    add_triangle(mesh, center, center + Vec3(0.1, 0, 0), center + Vec3(0, 0.1, 0.1));
    expected.push_back({299, 299, z});
  }
  const VoxelGrid grid = voxelize(mesh, cube_box(300.0), 1.0);
  EXPECT_EQ(grid.occupied, expected);
  write_binvox(folder / "v.binvox", grid);
  EXPECT_EQ(geometry::read_binvox(folder / "v.binvox").occupied, expected);
  EXPECT_EQ(cell_centers(grid).positions.back(), Vec3(299.5, 299.5, 299.5));
}

TEST(AirSimFaults, CellsAreNotShiftedByHalfACell) {
  TriangleMesh mesh;
  const Vec3 corner(100.0, 200.0, 50.0);
  add_triangle(mesh, corner + Vec3(0.1, 0.1, 0.1), corner + Vec3(1.9, 0.1, 0.1), corner + Vec3(0.1, 1.9, 1.9));
  const VoxelGrid grid = voxelize(mesh, Box3(corner, corner + Vec3::Constant(20.0)), 2.0);
  EXPECT_EQ(grid.occupied, (std::vector<Cell>{{0, 0, 0}}));
  EXPECT_EQ(grid.origin, corner);
  EXPECT_EQ(cell_centers(grid).positions[0], corner + Vec3::Constant(1.0));
}

TEST(AirSimFaults, TheMeshCountsNotItsCollisionShape) {
  // A U of three thin walls, seen from above. Its convex hull, a usual collision shape, would fill the inside; shapes
  // that are thinner than a cell vanish from others.
  TriangleMesh mesh;
  const Vec3 up(0, 0, 5);
  add_rectangle(mesh, Vec3(1.25, 1.25, 0.25), Vec3(0, 8, 0), up);
  add_rectangle(mesh, Vec3(1.25, 1.25, 0.25), Vec3(8, 0, 0), up);
  add_rectangle(mesh, Vec3(9.25, 1.25, 0.25), Vec3(0, 8, 0), up);
  const VoxelGrid grid = voxelize(mesh, Box3(Vec3::Zero(), Vec3(12, 12, 8)), 0.5);
  const std::set<Cell> occupied(grid.occupied.begin(), grid.occupied.end());
  for (std::int32_t i = 2; i <= 18; ++i) {
    for (std::int32_t z = 0; z <= 10; ++z) {
      EXPECT_TRUE(occupied.contains({2, i, z}) && occupied.contains({i, 2, z}) && occupied.contains({18, i, z}));
    }
  }
  EXPECT_EQ(occupied.size(), 11U * (17 + 16 + 16));  // the walls, one cell thick, and nothing else
}

TEST(AirSimFaults, CellsPerSideAreRoundedNotTruncated) {
  EXPECT_EQ(voxelize({}, cube_box(9.0), 0.3).dims, (std::array{30, 30, 30}));
  EXPECT_EQ(voxelize({}, Box3(Vec3::Zero(), Vec3(0.2, 250, 48)), 1.0).dims, (std::array{1, 250, 48}));
}

// Bad input.

TEST(VoxelizeErrors, EdgeThatIsNoLength) {
  for (const double edge_m : {0.0, -1.0, std::nan(""), HUGE_VAL}) {
    EXPECT_THAT([&] { voxelize({}, cube_box(1.0), edge_m); }, ThrowsMessage<InputError>(HasSubstr("above zero")));
  }
}

TEST(VoxelizeErrors, RegionThatIsEmpty) {
  const Vec3 nan = Vec3::Constant(std::nan(""));
  for (const Box3& box :
       {Box3(), Box3(Vec3::Zero(), Vec3(1, 1, 0)), Box3(Vec3(1, 1, 1), Vec3::Zero()), Box3(nan, nan)}) {
    EXPECT_THAT([&] { voxelize({}, box, 1.0); }, ThrowsMessage<InputError>(HasSubstr("region: is empty")));
  }
}

TEST(VoxelizeErrors, CornerThatIsNotFinite) {
  TriangleMesh mesh;
  add_triangle(mesh, Vec3(0, 0, 0), Vec3(1, 0, 0), Vec3(0, 1, 0));
  add_triangle(mesh, Vec3(0, 0, 0), Vec3(1, 0, std::nan("")), Vec3(0, 1, 0));
  EXPECT_THAT([&] { voxelize(mesh, cube_box(1.0), 1.0); },
              ThrowsMessage<InputError>(HasSubstr("triangle 1: a corner is not finite")));
}

TEST(VoxelizeErrors, AbsurdlyManyCellsAreRefusedWithTheirNumber) {
  TriangleMesh mesh;
  add_rectangle(mesh, Vec3(0, 0, 0.5), Vec3(1000, 0, 0), Vec3(0, 1000, 0));
  EXPECT_THAT([&] { voxelize(mesh, cube_box(1000.0), 1e-5); },
              ThrowsMessage<InputError>(HasSubstr("gives 100000000 cells along one axis")));
  EXPECT_THAT([&] { voxelize(mesh, cube_box(1000.0), 0.01); },
              ThrowsMessage<InputError>(HasSubstr("would occupy about 1000")));
}

TEST(Voxelize, ALongThinTriangleIsNotTakenForAHugeOne) {
  TriangleMesh mesh;
  add_triangle(mesh, Vec3(0, 0, 0), Vec3(100, 100, 100), Vec3(0.01, 0, 0));
  const VoxelGrid grid = voxelize(mesh, cube_box(100.0), 0.001);
  EXPECT_GT(grid.occupied.size(), 100000U);
  EXPECT_LT(grid.occupied.size(), 3000000U);
}

TEST(Voxelize, NothingInTheBoxIsAnEmptyGrid) {
  TriangleMesh mesh;
  add_triangle(mesh, Vec3(20, 0, 0), Vec3(21, 0, 0), Vec3(20, 1, 0));
  EXPECT_TRUE(voxelize(mesh, cube_box(8.0), 1.0).occupied.empty());
  EXPECT_TRUE(voxelize({}, cube_box(8.0), 1.0).occupied.empty());
}

}  // namespace
}  // namespace tileflight::ground_truth::voxelize_test

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

namespace tileflight::ground_truth::suggested_voxel_test {
namespace {

using geometry::Vec3;
using testing::HasSubstr;

TEST(SuggestedVoxel, IsThePublishedMetreForAPlaceOfThatSize) {
  EXPECT_DOUBLE_EQ(suggest_voxel_m({250, 250, 60}), 1.0);
  EXPECT_DOUBLE_EQ(suggest_voxel_m({5000, 3000, 60}), 1.0) << "a city too: the metre is what readers compare with";
}

TEST(SuggestedVoxel, IsFinerForSmallThings) {
  EXPECT_DOUBLE_EQ(suggest_voxel_m({8, 6, 20}), 0.1);
  EXPECT_DOUBLE_EQ(suggest_voxel_m({15, 12, 6}), 0.05);
  EXPECT_DOUBLE_EQ(suggest_voxel_m({120, 90, 10}), 0.5);
  EXPECT_DOUBLE_EQ(suggest_voxel_m({1, 1, 1}), 0.005);
  EXPECT_DOUBLE_EQ(suggest_voxel_m({0, 0, 0}), 0.001);
}

TEST(SuggestedVoxel, IsOneTwoOrFiveTimesAPowerOfTen) {
  for (double side_m = 0.3; side_m < 300; side_m *= 1.07) {
    const double edge_m = suggest_voxel_m({side_m, 0.5 * side_m, 0.1 * side_m});
    const double digit = edge_m / std::pow(10.0, std::floor(std::log10(edge_m) + 1e-9));
    EXPECT_TRUE(std::abs(digit - 1) < 1e-9 || std::abs(digit - 2) < 1e-9 || std::abs(digit - 5) < 1e-9) << edge_m;
    EXPECT_LT(std::abs(std::log(side_m / edge_m / 250)), std::log(1.6)) << side_m;
    EXPECT_FALSE(coarse_voxel_warning({side_m, 0.5 * side_m, 0.1 * side_m}, edge_m)) << side_m;
  }
}

TEST(SuggestedVoxel, AMetreOnAStatueIsSaidToBeCoarse) {
  const auto line = coarse_voxel_warning({8, 6, 20.26}, 1.0);
  ASSERT_TRUE(line);
  EXPECT_THAT(*line, HasSubstr("voxels of 1 m are coarse for a surface of 8 x 6 x 20.3 m"));
  EXPECT_THAT(*line, HasSubstr("use --voxel 0.1"));
  EXPECT_FALSE(coarse_voxel_warning({8, 6, 20.26}, 0.1));
  EXPECT_FALSE(coarse_voxel_warning({250, 250, 60}, 1.0));
  EXPECT_FALSE(coarse_voxel_warning({0, 0, 0}, 1.0));
}

}  // namespace
}  // namespace tileflight::ground_truth::suggested_voxel_test
