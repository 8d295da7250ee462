#include "tileflight/core/geometry/surface_heights.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "tests/height_field.h"

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
