#include "tileflight/simplification/surface_simplification.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <map>

#include "tileflight/base/noise.h"
#include "tileflight/simplification/simplify.h"

namespace tileflight::simplification::surface_simplification_test {
namespace {

using geometry::Triangle;
using geometry::TriangleMesh;
using geometry::Vec3;

double height(double x, double y) { return 0.5 * std::sin(0.5 * x) * std::cos(0.4 * y); }

/// A sheet of 20 x 20 cells over (x0, 0) to (x0 + 10, 10), each vertex displaced by up to `noise_m` along each axis.
imaging::TexturedMesh sheet(double x0, double noise_m, std::uint32_t seed) {
  imaging::TexturedMesh out;
  for (std::uint32_t j = 0; j <= 20; ++j)
    for (std::uint32_t i = 0; i <= 20; ++i) {
      const double x = x0 + 0.5 * i, y = 0.5 * j;
      const auto off = [&](std::uint32_t axis) { return noise_m * base::value_noise(7.3 * x, 7.1 * y, seed + axis); };
      out.mesh.vertices.emplace_back(x + off(0), y + off(1), height(x, y) + off(2));
      if (i == 20 || j == 20) continue;
      const std::uint32_t at = j * 21 + i;
      out.mesh.triangles.push_back({at, at + 1, at + 22});
      out.mesh.triangles.push_back({at, at + 22, at + 21});
    }
  return out;
}

/// Number of edges used by only one triangle, between `low` and `high` along x.
int border_edges(const TriangleMesh& mesh, double low, double high) {
  std::map<std::array<std::uint32_t, 2>, int> uses;
  for (const Triangle& t : mesh.triangles)
    for (std::size_t k = 0; k < 3; ++k) ++uses[{std::min(t[k], t[(k + 1) % 3]), std::max(t[k], t[(k + 1) % 3])}];
  int count = 0;
  for (const auto& [edge, n] : uses) {
    const double a = mesh.vertices[edge[0]].x(), b = mesh.vertices[edge[1]].x();
    if (n == 1 && std::min(a, b) > low && std::max(a, b) < high) ++count;
  }
  return count;
}

TEST(CoarserSurface, WeldingJoinsWhatIsAtTheSamePlace) {
  const TriangleMesh out = weld_vertices({sheet(0, 0, 1), sheet(10, 0, 1)});
  EXPECT_EQ(out.vertices.size(), 41U * 21);
  EXPECT_EQ(out.triangles.size(), 1600U);
  EXPECT_EQ(border_edges(out, 9, 11), 4);  // of the outline, to either side of the seam
}

TEST(CoarserSurface, BordersThatWereRoundedByThemselvesMeetAgain) {
  const TriangleMesh apart = weld_vertices({sheet(0, 0.01, 1), sheet(10, 0.01, 9)});
  EXPECT_EQ(apart.vertices.size(), 2U * 21 * 21);
  EXPECT_EQ(border_edges(apart, 9.2, 10.8), 4 + 2 * 20);
  const TriangleMesh joined = join_borders(apart, 0.06);
  EXPECT_EQ(joined.vertices.size(), 41U * 21);
  EXPECT_EQ(joined.triangles.size(), 1600U);
  EXPECT_EQ(border_edges(joined, 9.2, 10.8), 4);
  EXPECT_LE(hausdorff_distance_m(joined, apart), 0.05);
  EXPECT_EQ(join_borders(apart, 1e-4).vertices.size(), apart.vertices.size());
}

TEST(CoarserSurface, HasAboutTheTrianglesAskedForAndStaysNear) {
  const TriangleMesh fine = weld_vertices({sheet(0, 0, 1), sheet(10, 0, 1)});
  const TriangleMesh coarse = simplify_to_count(fine, 200);
  EXPECT_LE(coarse.triangles.size(), 200U);
  EXPECT_GT(coarse.triangles.size(), 150U);
  EXPECT_LT(hausdorff_distance_m(coarse, fine), 0.2);
}

TEST(CoarserSurface, ASoupOfTrianglesIsGatheredAndNeverEmpty) {
  imaging::TexturedMesh soup;
  for (std::uint32_t i = 0; i < 2000; ++i) {
    const Vec3 at(base::value_noise(0.31 * i, 0, 1) * 20, base::value_noise(0.37 * i, 0, 2) * 20,
                  base::value_noise(0.41 * i, 0, 3) * 2);
    soup.mesh.vertices.insert(soup.mesh.vertices.end(), {at, at + Vec3(0.3, 0, 0), at + Vec3(0, 0.3, 0.1)});
    soup.mesh.triangles.push_back({3 * i, 3 * i + 1, 3 * i + 2});
  }
  const TriangleMesh coarse = simplify_to_count(weld_vertices({soup}), 300);
  EXPECT_LE(coarse.triangles.size(), 600U);
  EXPECT_FALSE(coarse.triangles.empty());
  soup.mesh.triangles.resize(1);
  EXPECT_EQ(simplify_to_count(weld_vertices({soup}), 1).triangles.size(), 1U);
}

}  // namespace
}  // namespace tileflight::simplification::surface_simplification_test
