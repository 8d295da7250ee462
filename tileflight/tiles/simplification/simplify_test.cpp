#include "tileflight/tiles/simplification/simplify.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "tileflight/core/geometry/triangle_index.h"

namespace tileflight::simplification::simplify_test {
namespace {

using geometry::Vec3;
using imaging::TexturedMesh;

/// A sheet of cells x cells squares over (x0, 0) .. (x0 + 10, 10) with height f(x, y) and texture coordinates along it.
template <class Height>
TexturedMesh sheet(double x0, int cells, const Height& height) {
  TexturedMesh out;
  for (int j = 0; j <= cells; ++j) {
    for (int i = 0; i <= cells; ++i) {
      const double x = x0 + 10.0 * i / cells, y = 10.0 * j / cells;
      out.mesh.vertices.emplace_back(x, y, height(x, y));
      out.uv.emplace_back(static_cast<float>(i) / static_cast<float>(cells),
                          static_cast<float>(j) / static_cast<float>(cells));
    }
  }
  for (std::uint32_t j = 0; j < static_cast<std::uint32_t>(cells); ++j) {
    for (std::uint32_t i = 0; i < static_cast<std::uint32_t>(cells); ++i) {
      const auto row = static_cast<std::uint32_t>(cells) + 1, a = j * row + i;
      out.mesh.triangles.push_back({a, a + 1, a + 1 + row});
      out.mesh.triangles.push_back({a, a + 1 + row, a + row});
    }
  }
  return out;
}

double gentle(double x, double y) { return 0.3 * std::sin(0.6 * x) * std::cos(0.5 * y); }

TEST(Simplify, AFlatSheetKeepsItsOutlineAndItsTexture) {
  const TexturedMesh flat = sheet(0, 20, [](double, double) { return 0.0; });
  const TexturedMesh out = simplify_meshes({flat}, 0.01).front();
  EXPECT_LT(out.mesh.triangles.size(), flat.mesh.triangles.size() / 4);
  EXPECT_NEAR(geometry::surface_area_m2(out.mesh), 100.0, 1e-6);
  for (std::size_t i = 0; i < out.mesh.vertices.size(); ++i) {
    EXPECT_NEAR(out.uv[i].x(), out.mesh.vertices[i].x() / 10, 1e-6);
    EXPECT_NEAR(out.uv[i].y(), out.mesh.vertices[i].y() / 10, 1e-6);
  }
}

TEST(Simplify, NeighboursStillMeet) {
  const TexturedMesh west = sheet(0, 24, gentle), east = sheet(10, 24, gentle);
  const auto out = simplify_meshes({west, east}, 0.02);
  ASSERT_EQ(out.size(), 2U);
  EXPECT_LT(out[0].mesh.triangles.size(), west.mesh.triangles.size());
  const auto seam = [](const TexturedMesh& mesh) {
    std::vector<std::array<double, 2>> places;
    for (const Vec3& v : mesh.mesh.vertices)
      if (v.x() == 10.0) places.push_back({v.y(), v.z()});
    std::sort(places.begin(), places.end());
    return places;
  };
  EXPECT_EQ(seam(out[0]), seam(out[1]));
}

TEST(Simplify, MeasuredDistanceGrowsWithTheErrorAllowedAndStaysNearIt) {
  const TexturedMesh fine = sheet(0, 40, gentle);
  double last = 0;
  for (const double error_m : {0.005, 0.03, 0.1}) {
    const double distance_m = hausdorff_distance_m(simplify_meshes({fine}, error_m).front().mesh, fine.mesh);
    EXPECT_GE(distance_m, last);
    EXPECT_LT(distance_m, 4 * error_m);
    last = distance_m;
  }
  EXPECT_GT(last, 0.005);
}

TEST(SurfaceDistance, KnowsTwoPlanesAndAMissingPiece) {
  const TexturedMesh low = sheet(0, 5, [](double, double) { return 0.0; });
  const TexturedMesh high = sheet(0, 3, [](double, double) { return 0.25; });
  EXPECT_NEAR(hausdorff_distance_m(high.mesh, low.mesh), 0.25, 0.003);
  TexturedMesh both = low;
  const TexturedMesh far = sheet(14, 2, [](double, double) { return 0.0; });
  const auto first = static_cast<std::uint32_t>(both.mesh.vertices.size());
  both.mesh.vertices.insert(both.mesh.vertices.end(), far.mesh.vertices.begin(), far.mesh.vertices.end());
  for (const geometry::Triangle& t : far.mesh.triangles)
    both.mesh.triangles.push_back({first + t[0], first + t[1], first + t[2]});
  EXPECT_NEAR(hausdorff_distance_m(low.mesh, both.mesh), 14.0, 0.15);  // what vanished counts as well
}

TEST(SurfaceDistance, BoundsWhatDenseSamplingFinds) {
  const TexturedMesh a = sheet(0, 7, gentle),
                     b = sheet(0, 11, [](double x, double y) { return gentle(x, y) + 0.1 * std::sin(3 * x); });
  const geometry::TriangleIndex to_a(a.mesh), to_b(b.mesh);
  double sampled_m = 0;
  for (const auto& [mesh, index] : {std::pair{&a.mesh, &to_b}, std::pair{&b.mesh, &to_a}}) {
    for (const geometry::Triangle& t : mesh->triangles) {
      const Vec3 &p = mesh->vertices[t[0]], &q = mesh->vertices[t[1]], &r = mesh->vertices[t[2]];
      for (int i = 0; i <= 12; ++i)
        for (int j = 0; i + j <= 12; ++j)
          sampled_m = std::max(sampled_m, index->nearest(p + (q - p) * i / 12 + (r - p) * j / 12)->distance_m);
    }
  }
  const double bound_m = hausdorff_distance_m(a.mesh, b.mesh);
  EXPECT_GE(bound_m, sampled_m);
  EXPECT_LT(bound_m, 1.05 * sampled_m);
}

TEST(SurfaceDistance, SeesABumpBetweenTheCornersOfALargeTriangle) {
  const TexturedMesh coarse = sheet(0, 1, [](double, double) { return 0.0; });
  const TexturedMesh fine = sheet(0, 10, [](double x, double y) { return x == 4.0 && y == 6.0 ? 0.8 : 0.0; });
  EXPECT_NEAR(hausdorff_distance_m(coarse.mesh, fine.mesh), 0.8, 0.01);
  EXPECT_NEAR(hausdorff_distance_m(fine.mesh, coarse.mesh), 0.8, 0.01);
}

TEST(SurfaceDistance, BelowWhatIsAskedForIsNotToldApart) {
  const TexturedMesh low = sheet(0, 5, [](double, double) { return 0.0; });
  const TexturedMesh high = sheet(0, 3, [](double, double) { return 0.25; });
  EXPECT_NEAR(hausdorff_distance_m(high.mesh, low.mesh, 0.1), 0.25, 0.003);
  EXPECT_NEAR(hausdorff_distance_m(high.mesh, low.mesh, 0.5), 0.5, 0.006);
}

TEST(Simplify, DropsWhatNoTriangleUses) {
  TexturedMesh mesh = sheet(0, 3, gentle);
  const geometry::TriangleMesh before = mesh.mesh;
  mesh.mesh.triangles.resize(2);
  drop_unused_vertices(mesh);
  EXPECT_EQ(mesh.mesh.vertices.size(), 4U);
  EXPECT_EQ(mesh.uv.size(), 4U);
  for (std::size_t t = 0; t < 2; ++t)
    for (std::size_t k = 0; k < 3; ++k)
      EXPECT_EQ(mesh.mesh.vertices[mesh.mesh.triangles[t][k]], before.vertices[before.triangles[t][k]]);
}

}  // namespace
}  // namespace tileflight::simplification::simplify_test
