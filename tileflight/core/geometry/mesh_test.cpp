#include "tileflight/core/geometry/mesh.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "tests/height_field.h"

namespace tileflight::geometry::mesh_test {
namespace {

TEST(Mesh, BoundsAndArea) {
  const TriangleMesh mesh{{{0, 0, 0}, {3, 0, 0}, {0, 4, 0}, {0, 0, 2}}, {{0, 1, 2}, {0, 2, 3}}};
  EXPECT_DOUBLE_EQ(surface_area_m2(mesh), 6.0 + 4.0);
  EXPECT_EQ(bounds(mesh).max(), Vec3(3, 4, 2));
  EXPECT_TRUE(bounds({}).isEmpty());
  EXPECT_EQ(surface_area_m2({}), 0.0);
}

/// Distance by sampling a fine grid of barycentric weights: an upper bound, accurate to the grid's step.
double sampled_distance(const Vec3& p, const Vec3& a, const Vec3& b, const Vec3& c) {
  constexpr int kSteps = 200;
  double best = INFINITY;
  for (int i = 0; i <= kSteps; ++i) {
    for (int j = 0; i + j <= kSteps; ++j) {
      const Vec3 q = a + (b - a) * i / kSteps + (c - a) * j / kSteps;
      best = std::min(best, (q - p).norm());
    }
  }
  return best;
}

Vec3 random_point(std::mt19937& random, double size = 1.0) {
  std::uniform_real_distribution<double> uniform(-size, size);
  return {uniform(random), uniform(random), uniform(random)};
}

/// Whether q = a + v ab + w ac with v, w >= 0 and v + w <= 1.
bool on_triangle(const Vec3& q, const Vec3& a, const Vec3& b, const Vec3& c) {
  Eigen::Matrix<double, 3, 2> sides;
  sides << b - a, c - a;
  const Eigen::Vector2d w = sides.colPivHouseholderQr().solve(q - a);
  return (sides * w - (q - a)).norm() < 1e-9 && w.minCoeff() > -1e-9 && w.sum() < 1 + 1e-9;
}

TEST(ClosestPointOnTriangle, IsOnTheTriangleAndNoSampleIsNearer) {
  std::mt19937 random(7);
  for (int i = 0; i < 300; ++i) {
    const Vec3 a = random_point(random), b = random_point(random), c = random_point(random);
    const Vec3 p = random_point(random, 2.0);
    const Vec3 q = closest_point_on_triangle(p, a, b, c);
    EXPECT_TRUE(on_triangle(q, a, b, c));
    const double sampled = sampled_distance(p, a, b, c);
    EXPECT_LE((q - p).norm(), sampled + 1e-12);
    EXPECT_GE((q - p).norm(), sampled - 0.02);
  }
}

TEST(ClosestPointOnTriangle, EveryRegionOfAKnownTriangle) {
  const Vec3 a(0, 0, 0), b(1, 0, 0), c(0, 1, 0);
  const auto closest = [&](const Vec3& p) { return closest_point_on_triangle(p, a, b, c); };
  EXPECT_EQ(closest({-1, -1, 1}), a);
  EXPECT_EQ(closest({3, -0.5, 0}), b);
  EXPECT_EQ(closest({-0.5, 3, 0}), c);
  EXPECT_EQ(closest({0.25, -1, 2}), Vec3(0.25, 0, 0));
  EXPECT_EQ(closest({-1, 0.25, 2}), Vec3(0, 0.25, 0));
  EXPECT_LT((closest({1, 1, 0}) - Vec3(0.5, 0.5, 0)).norm(), 1e-15);
  EXPECT_LT((closest({0.25, 0.25, -3}) - Vec3(0.25, 0.25, 0)).norm(), 1e-15);
}

TEST(ClosestPointOnTriangle, WithoutAreaItIsASegmentOrAPoint) {
  const Vec3 a(1, 1, 1), b(3, 1, 1), middle(2, 1, 1);
  EXPECT_EQ(closest_point_on_triangle({0, 0, 0}, a, a, a), a);
  std::mt19937 random(9);
  for (const auto& [u, v, w] : {std::tuple{a, b, middle}, {b, middle, a}, {a, a, b}, {a, b, b}, {a, b, a}}) {
    for (int i = 0; i < 200; ++i) {
      const Vec3 p = random_point(random, 4.0);
      const Vec3 expected(std::clamp(p.x(), 1.0, 3.0), 1, 1);
      EXPECT_LT((closest_point_on_triangle(p, u, v, w) - expected).norm(), 1e-12);
    }
  }
}

TEST(ClosestPointOnTriangle, AlmostWithoutArea) {
  std::mt19937 random(11);
  for (int i = 0; i < 2000; ++i) {
    const Vec3 a = random_point(random), b = random_point(random);
    const Vec3 c = a + 0.3 * (b - a) + 1e-9 * random_point(random);
    const Vec3 p = random_point(random, 2.0);
    const Vec3 ab = b - a;
    const Vec3 on_segment = a + std::clamp((p - a).dot(ab) / ab.squaredNorm(), 0.0, 1.0) * ab;
    const double distance = (closest_point_on_triangle(p, a, b, c) - p).norm();
    EXPECT_NEAR(distance, (on_segment - p).norm(), 1e-8);
  }
}

}  // namespace
}  // namespace tileflight::geometry::mesh_test

namespace tileflight::geometry::surface_heights_test {
namespace {

using testing::DoubleNear;
using testing::ElementsAre;
using testing::IsEmpty;

/// A closed box.
TriangleMesh box(const Vec3& low, const Vec3& high) {
  TriangleMesh mesh;
  for (int corner = 0; corner < 8; ++corner) {
    mesh.vertices.emplace_back((corner & 1) != 0 ? high.x() : low.x(), (corner & 2) != 0 ? high.y() : low.y(),
                               (corner & 4) != 0 ? high.z() : low.z());
  }
  mesh.triangles = {{0, 2, 1}, {1, 2, 3}, {4, 5, 6}, {5, 7, 6}, {0, 1, 4}, {1, 5, 4},
                    {2, 6, 3}, {3, 6, 7}, {0, 4, 2}, {2, 4, 6}, {1, 3, 5}, {3, 7, 5}};
  return mesh;
}

void add(const TriangleMesh& more, TriangleMesh& mesh) {
  const auto first = static_cast<std::uint32_t>(mesh.vertices.size());
  mesh.vertices.insert(mesh.vertices.end(), more.vertices.begin(), more.vertices.end());
  for (const Triangle& t : more.triangles) mesh.triangles.push_back({t[0] + first, t[1] + first, t[2] + first});
}

TEST(SurfaceHeights, IsTheHeightOfAPlaneEverywhere) {
  const auto plane = [](double x, double y) { return 3.0 + 0.25 * x - 0.5 * y; };
  const TriangleMesh mesh = tests::height_field(16, -8.0, 16.0, plane);
  std::mt19937 random(1);
  std::uniform_real_distribution<double> across(-8, 8);
  for (int i = 0; i < 1000; ++i) {
    const double x = across(random), y = across(random);
    EXPECT_THAT(surface_heights_at(mesh, x, y), ElementsAre(DoubleNear(plane(x, y), 1e-12)));
  }
}

TEST(SurfaceHeights, MeetsEdgesAndCornersOnce) {
  const TriangleMesh mesh = tests::height_field(4, -2.0, 4.0, [](double, double) { return 7.0; });
  for (const auto& [x, y] : {std::pair(0.0, 0.0), {1.0, 0.5}, {0.5, 0.5}, {-2.0, -2.0}, {2.0, 2.0}, {-2.0, 1.25}})
    EXPECT_THAT(surface_heights_at(mesh, x, y), ElementsAre(7.0)) << x << " " << y;
}

TEST(SurfaceHeights, GivesEverySurfaceFromTheHighestDown) {
  TriangleMesh place = tests::height_field(8, -20.0, 40.0, [](double, double) { return 0.0; });
  add(box({-5, -1, 6}, {5, 1, 7}), place);  // a bridge
  EXPECT_THAT(surface_heights_at(place, 0.3, 0.4), ElementsAre(7.0, 6.0, 0.0));
  EXPECT_THAT(surface_heights_at(place, 0.3, 1.4), ElementsAre(0.0));
  EXPECT_THAT(surface_heights_at(place, 30, 0), IsEmpty());
  EXPECT_THAT(surface_heights_at(place, 20.0 + 1e-9, 0), IsEmpty());
}

TEST(SurfaceHeights, UprightTrianglesHaveNoHeight) {
  TriangleMesh wall;
  wall.vertices = {{0, 0, 0}, {4, 0, 0}, {4, 0, 3}, {0, 0, 3}};
  wall.triangles = {{0, 1, 2}, {0, 2, 3}};
  EXPECT_THAT(surface_heights_at(wall, 2, 0), IsEmpty());
  EXPECT_THAT(surface_heights_at({}, 0, 0), IsEmpty());
}

}  // namespace
}  // namespace tileflight::geometry::surface_heights_test
