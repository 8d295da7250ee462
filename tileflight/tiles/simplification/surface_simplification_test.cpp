#include "tileflight/tiles/simplification/surface_simplification.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <map>

#include "tileflight/core/base/noise.h"
#include "tileflight/tiles/simplification/simplify.h"

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

/// Whether the surface has a vertex at each fixed place.
bool has_all(const TriangleMesh& surface, const FixedVertices& fixed, std::size_t count) {
  std::size_t found = 0;
  for (const Vec3& v : surface.vertices) found += fixed.contains(v) ? 1 : 0;
  return found == count;
}

TEST(FixedBorders, PartsThatAreSimplifiedByThemselvesStillMeet) {
  const TriangleMesh left = weld_vertices({sheet(0, 0, 1)}), right = weld_vertices({sheet(10, 0, 1)});
  const std::vector<Vec3> border = border_positions(left);
  EXPECT_EQ(border.size(), 80U);
  const FixedVertices fixed = near_positions(border, 1e-6, [&](const auto& visit) {
    for (const Vec3& v : border_positions(right)) visit(v);
  });
  ASSERT_TRUE(has_all(left, fixed, 21));
  TriangleMesh a = left, b = right;
  for (const std::size_t count : {200U, 60U}) {
    a = simplify_to_count(a, count, fixed);
    b = simplify_to_count(b, count, fixed);
    EXPECT_TRUE(has_all(a, fixed, 21) && has_all(b, fixed, 21));
    EXPECT_LT(a.triangles.size(), 1.3 * static_cast<double>(count));
    imaging::TexturedMesh both_a, both_b;
    both_a.mesh = a;
    both_b.mesh = b;
    const TriangleMesh together = weld_vertices({both_a, both_b});
    EXPECT_EQ(together.triangles.size(), a.triangles.size() + b.triangles.size());
    int seam = 0;  // edges of one triangle with both ends on the seam
    std::map<std::array<std::uint32_t, 2>, int> uses;
    for (const Triangle& t : together.triangles)
      for (std::size_t k = 0; k < 3; ++k) ++uses[{std::min(t[k], t[(k + 1) % 3]), std::max(t[k], t[(k + 1) % 3])}];
    for (const auto& [edge, n] : uses)
      seam += n == 1 && fixed.contains(together.vertices[edge[0]]) && fixed.contains(together.vertices[edge[1]]);
    EXPECT_EQ(seam, 0);
  }
  EXPECT_FALSE(has_all(simplify_to_count(left, 60), fixed, 21)) << "without being told, it does not keep them";
}

TEST(FixedBorders, NearPlacesAreThoseWithinTheDistance) {
  base::HashRandom random(5);
  std::vector<Vec3> own, others;
  for (int i = 0; i < 300; ++i) {
    own.emplace_back(random.uniform(0, 3), random.uniform(0, 3), random.uniform(0, 0.3));
    others.emplace_back(random.uniform(0, 3), random.uniform(0, 3), random.uniform(0, 0.3));
  }
  const FixedVertices near = near_positions(own, 0.15, [&](const auto& visit) {
    for (const Vec3& v : others) visit(v);
  });
  int count = 0;
  for (const Vec3& v : own) {
    bool is_near = false;
    for (const Vec3& other : others) is_near |= (v - other).norm() <= 0.15;
    EXPECT_EQ(near.contains(v), is_near);
    count += is_near ? 1 : 0;
  }
  EXPECT_GT(count, 50);
  EXPECT_LT(count, 250);
}

TEST(FixedBorders, JoiningMovesOthersToThem) {
  const TriangleMesh apart = weld_vertices({sheet(0, 0.01, 1), sheet(10, 0.01, 9)});
  FixedVertices fixed;  // the border of the right sheet, which comes second
  std::size_t count = 0;
  for (const Vec3& v : border_positions(weld_vertices({sheet(10, 0.01, 9)})))
    if (v.x() < 10.1) fixed.add(v), ++count;
  ASSERT_EQ(count, 21U);
  EXPECT_FALSE(has_all(join_borders(apart, 0.06), fixed, 21));
  const TriangleMesh joined = join_borders(apart, 0.06, fixed);
  EXPECT_TRUE(has_all(joined, fixed, 21));
  EXPECT_EQ(joined.vertices.size(), 41U * 21);
}

TEST(FixedBorders, ASoupIsGatheredAroundThem) {
  imaging::TexturedMesh soup;
  FixedVertices fixed;
  for (std::uint32_t i = 0; i < 2000; ++i) {
    const Vec3 at(base::value_noise(0.31 * i, 0, 1) * 20, base::value_noise(0.37 * i, 0, 2) * 20,
                  base::value_noise(0.41 * i, 0, 3) * 2);
    soup.mesh.vertices.insert(soup.mesh.vertices.end(), {at, at + Vec3(0.3, 0, 0), at + Vec3(0, 0.3, 0.1)});
    soup.mesh.triangles.push_back({3 * i, 3 * i + 1, 3 * i + 2});
    if (i % 50 == 0)
      for (std::size_t k = 1; k <= 3; ++k) fixed.add(soup.mesh.vertices[soup.mesh.vertices.size() - k]);
  }
  const TriangleMesh coarse = simplify_to_count(weld_vertices({soup}), 300, fixed);
  EXPECT_TRUE(has_all(coarse, fixed, 120));
  EXPECT_LE(coarse.triangles.size(), 600U);
}

}  // namespace
}  // namespace tileflight::simplification::surface_simplification_test
