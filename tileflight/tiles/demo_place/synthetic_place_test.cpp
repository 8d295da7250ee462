#include "tileflight/tiles/demo_place/synthetic_place.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <set>
#include <utility>

#include "tests/refusal.h"
#include "tests/same_files.h"
#include "tests/temporary_folder.h"
#include "tileflight/core/geometry/triangle_index.h"
#include "tileflight/tiles/simplification/simplify.h"
#include "tileflight/tiles/tileset/load.h"

namespace tileflight::demo_place::synthetic_place_test {
namespace {

namespace fs = std::filesystem;
using geometry::Vec3;
using ::testing::HasSubstr;
using tests::refusal_of;

tileset::LoadedTiles load(const fs::path& place, const std::string& model) {
  tileset::LoadOptions options;
  options.center = options.origin = geometry::Geodetic{30.0, -40.0, {50.0}};
  options.size = {300.0, 300.0, 300.0};
  return tileset::load_region((place / model).string(), options);
}

class SyntheticPlaces : public ::testing::TestWithParam<PlaceName> {
 protected:
  tests::TemporaryFolder folder_;
};

/// Both models are whole, of 200 m, near their site; the twin is coarser and within decimetres of the world; something
/// stands more than 3 m above what is around it.
TEST_P(SyntheticPlaces, AreWholeAndTheTwinLiesOnTheWorld) {
  write_place(folder_.path(), GetParam().kind, {.seed = 3, .texture_scale = 0.05});
  const tileset::LoadedTiles world = load(folder_.path(), "world"), twin = load(folder_.path(), "twin");
  for (const tileset::LoadedTiles* model : {&world, &twin}) {
    EXPECT_TRUE(model->complete);
    EXPECT_TRUE(model->warnings.empty()) << model->warnings.front();
  }
  EXPECT_GT(world.triangles, 60'000);
  EXPECT_LT(world.triangles, 1'500'000);
  EXPECT_LT(twin.triangles, 0.8 * static_cast<double>(world.triangles));
  const geometry::TriangleMesh merged = simplification::merge_meshes(world.meshes);
  geometry::Box3 box;
  for (const Vec3& vertex : merged.vertices) box.extend(vertex);
  EXPECT_NEAR(box.center().head<2>().norm(), 0.0, 4.0);
  EXPECT_GT(box.sizes().x(), 200.0);
  EXPECT_LT(box.sizes().x(), 290.0) << "turned by its heading";
  EXPECT_GT(box.sizes().z(), 8.0);
  EXPECT_LT(box.sizes().z(), 80.0);
  const geometry::TriangleIndex surface(merged);
  double sum = 0.0;
  std::size_t count = 0, far = 0;
  for (const imaging::TexturedMesh& mesh : twin.meshes) {
    for (std::size_t i = 0; i < mesh.mesh.vertices.size(); i += 11, ++count) {
      const double distance_m = surface.nearest(mesh.mesh.vertices[i])->distance_m;
      sum += distance_m;
      far += distance_m > 0.3;
    }
  }
  EXPECT_LT(sum / static_cast<double>(count), 0.07);
  EXPECT_LT(static_cast<double>(far), 0.002 * static_cast<double>(count));
}

/// Square metres in which an object has its middle.
std::set<std::pair<int, int>> object_cells(const SyntheticPlace& place) {
  const auto leaves = static_cast<std::size_t>(std::pow(2.0 * place.half_m / SyntheticPlace::kLeaf_m, 2));
  std::set<std::pair<int, int>> cells;
  for (std::size_t i = leaves; i < place.charts.size(); ++i) {
    geometry::Box3 box;
    for (const Vec3& vertex : place.charts[i].vertices) box.extend(vertex);
    cells.emplace(static_cast<int>(std::floor(box.center().x())), static_cast<int>(std::floor(box.center().y())));
  }
  return cells;
}

/// A seed is another layout, not only other colours.
TEST_P(SyntheticPlaces, DifferInLayoutBetweenSeeds) {
  const auto first = object_cells(make_place(GetParam().kind, 1)),
             second = object_cells(make_place(GetParam().kind, 2));
  EXPECT_GT(first.size(), 50U);
  EXPECT_EQ(first, object_cells(make_place(GetParam().kind, 1)));
  const auto common = std::ranges::count_if(second, [&](const auto& cell) { return first.contains(cell); });
  EXPECT_LT(static_cast<double>(common), 0.4 * static_cast<double>(second.size()));
}

INSTANTIATE_TEST_SUITE_P(Kinds, SyntheticPlaces, ::testing::ValuesIn(place_names().subspan(1)),
                         [](const auto& info) { return std::string(info.param.name); });

TEST(SyntheticPlace, TheSameSeedGivesTheSameBytes) {
  const tests::TemporaryFolder folder;
  for (const char* name : {"a", "b"})
    write_place(folder / name, PlaceKind::kWorks, {.seed = 5, .texture_scale = 0.02, .twin = false});
  tests::expect_same_files(folder / "a", folder / "b");
}

TEST(BuiltInSource, NamesKindSeedAndModel) {
  EXPECT_EQ(built_in_source("stadium:twin")->kind, PlaceKind::kStadium);
  EXPECT_FALSE(built_in_source("stadium:twin")->seed);
  EXPECT_EQ(built_in_source("fort-12:world")->seed, 12U);
  EXPECT_EQ(built_in_source("fort-12:world")->model, "world");
  for (const char* other : {"place/twin", "ion:123", "https://town:8080/x", "town", "town/twin:x", "s3://b"})
    EXPECT_FALSE(built_in_source(other)) << other;
  EXPECT_THAT(refusal_of([] { built_in_source("town:triplet"); }), HasSubstr("use town:twin or town:world"));
  EXPECT_THAT(refusal_of([] { built_in_source("town-:twin"); }), HasSubstr("no whole number"));
  EXPECT_THAT(refusal_of([] { built_in_source("town--1:twin"); }), HasSubstr("no whole number"));
}

}  // namespace
}  // namespace tileflight::demo_place::synthetic_place_test
