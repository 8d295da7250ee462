#include "tileflight/tiles/demo_place/stadium.h"

#include <gtest/gtest.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <set>

#include "tests/temporary_folder.h"
#include "tileflight/core/geometry/triangle_index.h"
#include "tileflight/tiles/demo_place/bake_charts.h"
#include "tileflight/tiles/demo_place/stadium_parts.h"
#include "tileflight/tiles/simplification/simplify.h"
#include "tileflight/tiles/tileset/load.h"

namespace tileflight::demo_place::stadium_test {
namespace {

TEST(SitePlan, IsTheSameForTheSameSeedAndNotForAnother) {
  const SitePlan a = make_site_plan(1), b = make_site_plan(1), c = make_site_plan(2);
  ASSERT_EQ(a.trees.size(), b.trees.size());
  for (std::size_t i = 0; i < a.trees.size(); ++i) EXPECT_EQ(a.trees[i].position, b.trees[i].position);
  EXPECT_NE(a.trees.front().position, c.trees.front().position);
}

TEST(SitePlan, NoTreeStandsOnPavingOrInAWall) {
  const SitePlan plan = make_site_plan(1);
  EXPECT_GT(plan.trees.size(), 300U);
  for (const Tree& tree : plan.trees) EXPECT_GT(plan.clearance_m(tree.position.x(), tree.position.y()), 0.5);
}

TEST(Terrain, IsABowlAroundAFlatField) {
  const Terrain terrain(make_site_plan(1));
  for (double y = -60; y <= 60; y += 7)
    for (double x = -30; x <= 30; x += 5) EXPECT_NEAR(terrain.height_m(x, y), 0.125, 0.126);
  for (double y = -66; y <= 66; y += 7)
    for (const double x : {-32.0, 32.0}) EXPECT_LT(std::fabs(terrain.height_m(x, y)), 0.1);  // no step at its edge
  EXPECT_GT(terrain.height_m(-66, 58), 11.0);
  EXPECT_GT(terrain.height_m(64, 54), 9.0);
  EXPECT_GT(terrain.height_m(20, 94), 6.0);
  EXPECT_LT(terrain.height_m(20, -78), 3.0);
}

TEST(Bake, PaintsTheSameForAnyNumberOfThreads) {
  const SitePlan plan = make_site_plan(1);
  const Terrain terrain(plan);
  const std::vector<Chart> charts = make_stands(plan, terrain);
  const Sunlight sun({-0.5, -0.4, 0.8}, charts, 0.5);
  std::vector<const Chart*> all;
  for (const Chart& chart : charts) all.push_back(&chart);
  const auto parallel = bake_charts(all, sun, 0.2);
  tbb::task_arena(1).execute([&] { EXPECT_EQ(bake_charts(all, sun, 0.2).texture->pixels, parallel.texture->pixels); });
}

TEST(Bake, ATextureIsPaintedWhereItsCoordinatesSay) {
  const auto paint = [](const Texel& t) {
    return Color(static_cast<float>(t.position.x() / 10), static_cast<float>(t.position.y() / 6), 0.25F);
  };
  std::vector<Chart> charts{make_panel({0, 0, 0}, {10, 0, 0}, {0, 6, 0}, paint),
                            make_panel({2, 1, 3}, {5, 0, 0}, {0, 4, 0}, paint)};
  const std::vector<Chart> far_off{
      make_panel({500, 0, -90}, {1, 0, 0}, {0, 1, 0}, paint)};  // nothing casts a shadow here
  const Sunlight sun({0, 0, 1}, far_off, 1.0);
  const auto mesh = bake_charts({&charts[0], &charts[1]}, sun, 1.0);
  const float light = sun.light_factor({0, 0, 0}, Vec3::UnitZ());
  ASSERT_FALSE(mesh.mesh.triangles.empty());
  for (const geometry::Triangle& t : mesh.mesh.triangles) {
    const Vec3 p = (mesh.mesh.vertices[t[0]] + mesh.mesh.vertices[t[1]] + mesh.mesh.vertices[t[2]]) / 3;
    const Eigen::Vector2f uv = (mesh.uv[t[0]] + mesh.uv[t[1]] + mesh.uv[t[2]]) / 3;
    const auto& texture = *mesh.texture;
    const imaging::Rgb8 color = texture(static_cast<int>(uv.x() * static_cast<float>(texture.width)),
                                        static_cast<int>(uv.y() * static_cast<float>(texture.height)));
    EXPECT_NEAR(color[0], std::min(255.0, 25.5 * p.x() * light), 3);
    EXPECT_NEAR(color[1], std::min(255.0, 255.0 / 6 * p.y() * light), 4);
  }
}

tileset::LoadedTiles load(const std::filesystem::path& place, const std::string& model, const geometry::Vec3& size) {
  tileset::LoadOptions options;
  options.center = options.origin = geometry::Geodetic{kStadiumLatitudeDeg, kStadiumLongitudeDeg, {kStadiumHeightM}};
  options.size = size;
  return tileset::load_region((place / model).string(), options);
}

void expect_lies_where_the_paper_flew(const std::filesystem::path& place) {
  for (const std::string model : {"world", "twin"}) {
    const tileset::LoadedTiles loaded = load(place, model, {250, 250, 100});
    EXPECT_TRUE(loaded.complete);
    EXPECT_TRUE(loaded.warnings.empty()) << loaded.warnings.front();
    EXPECT_EQ(loaded.geometric_error_max_m, 0.0);
    const geometry::TriangleIndex surface(simplification::merge_meshes(loaded.meshes));
    EXPECT_NEAR(surface.nearest({0, 0, 0.25})->distance_m, 0.0,
                model == "world" ? 0.02 : 0.2);  // midfield, on its crown
    // The stands rise on both sides of the field, whose long axis points 17 degrees east of north.
    const double c = std::cos(17 * M_PI / 180), s = std::sin(17 * M_PI / 180);
    EXPECT_LT(surface.nearest({-50 * c, 50 * s, 10.2})->distance_m, 0.6);
    EXPECT_LT(surface.nearest({50 * c, -50 * s, 10.0})->distance_m, 0.6);
    EXPECT_GT(surface.nearest({40 * s, 40 * c, 5.0})->distance_m, 4.0);
  }
}

void expect_fine_world_and_lesser_twin(const std::filesystem::path& place) {
  const tileset::LoadedTiles world = load(place, "world", {600, 600, 200}), twin = load(place, "twin", {600, 600, 200});
  EXPECT_GT(world.triangles, 300000);
  EXPECT_LT(world.triangles, 900000);
  EXPECT_GT(twin.triangles, 100000);
  EXPECT_LT(twin.triangles, 300000);
}

void expect_twin_on_the_world(const std::filesystem::path& place) {
  const tileset::LoadedTiles world = load(place, "world", {600, 600, 200}), twin = load(place, "twin", {600, 600, 200});
  const geometry::TriangleIndex surface(simplification::merge_meshes(world.meshes));
  double sum = 0;
  std::size_t count = 0;
  for (const imaging::TexturedMesh& mesh : twin.meshes) {
    for (std::size_t i = 0; i < mesh.mesh.vertices.size(); i += 7, ++count) {
      const double distance_m = surface.nearest(mesh.mesh.vertices[i])->distance_m;
      EXPECT_LT(distance_m, 0.25);
      sum += distance_m;
    }
  }
  EXPECT_GT(sum / static_cast<double>(count), 0.01);
  EXPECT_LT(sum / static_cast<double>(count), 0.06);
}

void expect_as_much_structure_as_the_papers_place(const std::filesystem::path& place) {
  std::set<std::array<int, 3>> cells;
  for (const imaging::TexturedMesh& mesh : load(place, "twin", {250, 250, 100}).meshes) {
    for (const geometry::Triangle& t : mesh.mesh.triangles) {
      const Vec3 &a = mesh.mesh.vertices[t[0]], &b = mesh.mesh.vertices[t[1]], &c = mesh.mesh.vertices[t[2]];
      const int steps = 1 + static_cast<int>(3 * std::max({(b - a).norm(), (c - b).norm(), (a - c).norm()}));
      for (int i = 0; i <= steps; ++i) {
        for (int j = 0; i + j <= steps; ++j) {
          const Vec3 p = a + (b - a) * i / steps + (c - a) * j / steps;
          if (std::max(std::fabs(p.x()), std::fabs(p.y())) < 125)
            cells.insert({static_cast<int>(std::floor(p.x())), static_cast<int>(std::floor(p.y())),
                          static_cast<int>(std::floor(p.z()))});
        }
      }
    }
  }
  EXPECT_GT(cells.size(),
            110000U);  // 158 446 in the paper; points miss about 5 % of the cells that the surface touches
  EXPECT_LT(cells.size(), 200000U);
}

// A single test, because writing the site takes a while, even with small textures.
TEST(Stadium, IsThePapersPlaceTwice) {
  const tests::TemporaryFolder place;
  write_stadium(place.path(), {1, 0.05});
  expect_lies_where_the_paper_flew(place.path());
  expect_fine_world_and_lesser_twin(place.path());
  expect_twin_on_the_world(place.path());
  expect_as_much_structure_as_the_papers_place(place.path());
}

}  // namespace
}  // namespace tileflight::demo_place::stadium_test
