#include "tileflight/core/geometry/triangle_pack.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <random>

namespace tileflight::geometry::triangle_pack_test {
namespace {

/// Four triangles around the origin, all of one kind.
TriangleMesh four_triangles(std::mt19937& random, const std::function<Vec3(int corner)>& corner) {
  TriangleMesh mesh;
  std::normal_distribution<double> place(0.0, 1.0);
  for (std::uint32_t i = 0; i < 4; ++i) {
    const Vec3 center(place(random), place(random), place(random));
    for (int k = 0; k < 3; ++k) mesh.vertices.push_back(center + corner(k));
    mesh.triangles.push_back({3 * i, 3 * i + 1, 3 * i + 2});
  }
  return mesh;
}

TrianglePack::Nearest one_by_one(const TriangleMesh& mesh, const std::vector<std::uint32_t>& chosen,
                                 const Vec3& query) {
  TrianglePack::Nearest best{INFINITY};
  for (const std::uint32_t i : chosen) {
    const auto& [a, b, c] = mesh.triangles[i];
    const Vec3 p = closest_point_on_triangle(query, mesh.vertices[a], mesh.vertices[b], mesh.vertices[c]);
    const double distance2 = (p - query).squaredNorm();
    if (distance2 < best.distance2 || (distance2 == best.distance2 && i < best.triangle)) best = {distance2, i, p};
  }
  return best;
}

/// Bit-identical: the nearest point must not depend on how triangles are packed.
void expect_one_by_one(const TriangleMesh& mesh, std::mt19937& random) {
  std::uniform_real_distribution<double> place(-3.0, 3.0);
  for (const std::vector<std::uint32_t>& chosen : {std::vector<std::uint32_t>{2}, {3, 1}, {0, 2, 1}, {3, 0, 1, 2}}) {
    const TrianglePack pack(mesh, chosen);
    for (int i = 0; i < 50; ++i) {
      const Vec3 query(place(random), place(random), place(random));
      const TrianglePack::Nearest expected = one_by_one(mesh, chosen, query);
      const TrianglePack::Nearest found = pack.nearest(query);
      EXPECT_EQ(found.triangle, expected.triangle);
      EXPECT_EQ(found.distance2, expected.distance2);
      EXPECT_EQ(found.position, expected.position);
    }
  }
}

TEST(TrianglePack, IsEachTriangleByItself) {
  std::mt19937 random(1);
  std::normal_distribution<double> off(0.0, 1.0);
  for (int i = 0; i < 50; ++i) {
    expect_one_by_one(four_triangles(random, [&](int) { return Vec3(off(random), off(random), off(random)); }), random);
  }
}

TEST(TrianglePack, IsEachTriangleByItselfWithoutArea) {
  std::mt19937 random(2);
  std::normal_distribution<double> off(0.0, 1.0);
  expect_one_by_one(four_triangles(random, [&](int k) { return Vec3(1.0 * k, -2.0 * k, 0.5 * k); }), random);
  expect_one_by_one(four_triangles(random, [&](int k) { return Vec3(k == 1 ? 1.0 : 0.0, 0.0, 0.0); }), random);
  expect_one_by_one(four_triangles(random, [&](int) { return Vec3(0, 0, 0); }), random);
  expect_one_by_one(four_triangles(random, [&](int k) { return Vec3(k, 1e-9 * off(random), 0.0); }), random);
}

TEST(TrianglePack, KeepsItsCorners) {
  std::mt19937 random(3);
  const TriangleMesh mesh = four_triangles(random, [](int k) { return Vec3(k, k * k, 1.0); });
  const TrianglePack pack(mesh, std::vector<std::uint32_t>{1, 3});
  for (std::size_t k = 0; k < 3; ++k) {
    EXPECT_EQ(pack.corner(k, 0), mesh.vertices[mesh.triangles[1][k]]);
    EXPECT_EQ(pack.corner(k, 1), mesh.vertices[mesh.triangles[3][k]]);
    EXPECT_EQ(pack.corner(k, 3), pack.corner(k, 1));
  }
}

}  // namespace
}  // namespace tileflight::geometry::triangle_pack_test
