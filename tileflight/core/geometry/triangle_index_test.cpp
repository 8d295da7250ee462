#include "tileflight/core/geometry/triangle_index.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <cmath>
#include <random>

#include "tests/height_field.h"
#include "tileflight/core/base/input_error.h"

namespace tileflight::geometry::triangle_index_test {
namespace {

using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

TriangleMesh random_mesh(int triangles, unsigned seed, double size_m, const Vec3& offset) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> place(-50.0, 50.0);
  std::normal_distribution<double> corner(0.0, size_m);
  TriangleMesh mesh;
  for (int i = 0; i < triangles; ++i) {
    const Vec3 center = offset + Vec3(place(random), place(random), 0.1 * place(random));
    for (int k = 0; k < 3; ++k) mesh.vertices.push_back(center + Vec3(corner(random), corner(random), corner(random)));
    const auto first = static_cast<std::uint32_t>(3 * i);
    mesh.triangles.push_back({first, first + 1, first + 2});
  }
  return mesh;
}

/// A flat square of side x side squares, two triangles each: neighbours share sides, so many distances are equal.
TriangleMesh flat_grid(std::uint32_t side) {
  return tests::height_field(side, 0.0, side, [](double, double) { return 0.0; });
}

SurfacePoint brute_force(const TriangleMesh& mesh, const Vec3& query) {
  SurfacePoint best{Vec3::Zero(), INFINITY, 0};
  double best2 = INFINITY;
  for (std::size_t i = 0; i < mesh.triangles.size(); ++i) {
    const Triangle& t = mesh.triangles[i];
    const Vec3 p = closest_point_on_triangle(query, mesh.vertices[t[0]], mesh.vertices[t[1]], mesh.vertices[t[2]]);
    const double distance2 = (p - query).squaredNorm();
    if (distance2 < best2) {
      best2 = distance2;
      best = {p, std::sqrt(distance2), i};
    }
  }
  return best;
}

void expect_brute_force(const TriangleMesh& mesh, const TriangleIndex& index, const Vec3& query) {
  const auto found = index.nearest(query);
  const SurfacePoint expected = brute_force(mesh, query);
  ASSERT_TRUE(found);
  EXPECT_EQ(found->triangle, expected.triangle);
  EXPECT_EQ(found->distance_m, expected.distance_m);
  EXPECT_EQ(found->position, expected.position);
}

TEST(TriangleIndex, EqualsBruteForceForAnyNumberOfTriangles) {
  std::mt19937 random(2);
  std::uniform_real_distribution<double> uniform(-80.0, 80.0);
  for (const int triangles : {1, 2, 3, 4, 5, 6, 7, 17, 100, 1001}) {
    const TriangleMesh mesh = random_mesh(triangles, static_cast<unsigned>(triangles), 2.0, Vec3::Zero());
    const TriangleIndex index(mesh);
    for (int i = 0; i < 100; ++i)
      expect_brute_force(mesh, index, Vec3(uniform(random), uniform(random), uniform(random)));
  }
}

TEST(TriangleIndex, KeepsDoublePrecisionFarFromTheOrigin) {
  const Vec3 far(1.3e6, -5.1e6, 3.6e6);  // earth-centred coordinates
  const TriangleMesh mesh = random_mesh(3000, 5, 0.01, far);
  const TriangleIndex index(mesh);
  std::mt19937 random(6);
  std::uniform_real_distribution<double> uniform(-60.0, 60.0);
  for (int i = 0; i < 200; ++i) {
    expect_brute_force(mesh, index, far + Vec3(uniform(random), uniform(random), uniform(random)));
    expect_brute_force(mesh, index, mesh.vertices[static_cast<std::size_t>(i)]);
  }
}

TEST(TriangleIndex, QueriesFarAway) {
  const TriangleMesh mesh = random_mesh(500, 8, 1.0, Vec3::Zero());
  const TriangleIndex index(mesh);
  for (const double distance : {1e3, 1e6, 1e9}) {
    for (int axis = 0; axis < 3; ++axis) expect_brute_force(mesh, index, distance * Vec3::Unit(axis));
  }
  EXPECT_TRUE(index.nearest(Vec3(1e30, -1e30, 0)));
}

TEST(TriangleIndex, LowestTriangleOfEqualDistancesWins) {
  const TriangleMesh mesh = flat_grid(20);
  const TriangleIndex index(mesh);
  for (int y = -1; y <= 42; ++y) {
    for (int x = -1; x <= 42; ++x) expect_brute_force(mesh, index, Vec3(0.5 * x, 0.5 * y, 1.0));
  }
}

TEST(TriangleIndex, ManyTrianglesAtOnePlace) {
  TriangleMesh mesh{{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, {}};
  mesh.triangles.assign(1000, {0, 1, 2});
  const TriangleIndex index(mesh);
  EXPECT_EQ(index.nearest(Vec3(0.2, 0.2, 1))->triangle, 0U);
}

TEST(TriangleIndex, TrianglesWithoutArea) {
  const TriangleMesh mesh{{{0, 0, 0}, {1, 0, 0}, {2, 0, 0}, {9, 9, 9}}, {{3, 3, 3}, {0, 1, 2}, {0, 0, 1}}};
  const TriangleIndex index(mesh);
  EXPECT_EQ(index.nearest(Vec3(1.5, 1, 0))->position, Vec3(1.5, 0, 0));
  EXPECT_EQ(index.nearest(Vec3(9, 9, 10))->triangle, 0U);
}

TEST(TriangleIndex, RadiusIsInclusiveAndNothingIsNothing) {
  const TriangleIndex index(TriangleMesh{{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, {{0, 1, 2}}});
  EXPECT_TRUE(index.nearest(Vec3(0.25, 0.25, 2), 2.0));
  EXPECT_FALSE(index.nearest(Vec3(0.25, 0.25, 2), 1.999999));
  EXPECT_FALSE(index.nearest(Vec3(std::nan(""), 0, 0)));
  EXPECT_FALSE(index.nearest(Vec3(0, 0, 0), -1.0));
  EXPECT_FALSE(TriangleIndex(TriangleMesh{}).nearest(Vec3(0, 0, 0)));
}

TEST(TriangleIndex, RefusesVerticesThatAreNotFinite) {
  EXPECT_THAT(
      [&] {
        TriangleIndex(TriangleMesh{{{0, 0, 0}, {1, std::nan(""), 0}, {0, 1, 0}}, {{0, 1, 2}}});
      },
      ThrowsMessage<InputError>(HasSubstr("mesh: a vertex is not finite")));
  EXPECT_THAT(
      [&] {
        TriangleIndex(TriangleMesh{{{0, 0, 0}, {1, INFINITY, 0}, {0, 1, 0}}, {{0, 1, 2}}});
      },
      ThrowsMessage<InputError>(HasSubstr("mesh: a vertex is not finite")));
}

TEST(TriangleIndex, SameAnswersForAnyNumberOfThreads) {
  const TriangleMesh mesh = random_mesh(30000, 12, 0.5, Vec3::Zero());
  const TriangleIndex parallel(mesh);
  const tbb::global_control one(tbb::global_control::max_allowed_parallelism, 1);
  const TriangleIndex serial(mesh);
  for (std::size_t i = 0; i < 2000; ++i) {
    const Vec3 query = mesh.vertices[i] + Vec3(0.3, 0.2, 1.0);
    EXPECT_EQ(parallel.nearest(query)->triangle, serial.nearest(query)->triangle);
    EXPECT_EQ(parallel.nearest(query)->position, serial.nearest(query)->position);
  }
}

}  // namespace
}  // namespace tileflight::geometry::triangle_index_test
