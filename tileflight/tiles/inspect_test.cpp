#include "tileflight/tiles/inspect.h"

#include <gmock/gmock.h>

#include "tests/test_data.h"
#include "tileflight/tiles/test_tilesets.h"

namespace tileflight::tiles {
namespace {

using testing::box_volume;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using testing::Json;
using testing::MemorySource;
using ::testing::Pair;
using testing::tile;
using ::testing::UnorderedElementsAre;

TEST(InspectTileset, counts_what_is_there) {
  Json root = tile(box_volume(0, 0, 0, 10, 20, 30), 8);
  root["children"] = {tile(box_volume(0, 0, 0, 1, 1, 1), 4, "a.glb"), tile(box_volume(0, 0, 0, 1, 1, 1), 2, "t.json"),
                      tile(box_volume(0, 0, 0, 1, 1, 1), 3, "none.json")};
  Json json = testing::tileset(root);
  json["asset"]["copyright"] = "A";
  json["extensionsUsed"] = {"X", "Y"};
  json["extensionsRequired"] = {"Y"};
  MemorySource source(json);
  Json inner = tile(box_volume(0, 0, 0, 1, 1, 1), 1, "a.glb");
  inner["refine"] = "ADD";
  inner["children"] = Json::array({tile(box_volume(0, 0, 0, 1, 1, 1), 0, "b.b3dm")});
  Json external = testing::tileset(inner);
  external["asset"]["copyright"] = "B; A";
  source.add("t.json", external.dump());
  source.add("a.glb", std::string("12345"));

  const TilesetSummary s = inspect_tileset(source);
  EXPECT_EQ(s.version, "1.1");
  EXPECT_EQ(s.tiles, 6);
  EXPECT_EQ(s.tiles_with_content, 5);
  EXPECT_EQ(s.leaves, 4);
  EXPECT_EQ(s.tiles_add, 1);
  EXPECT_EQ(s.tiles_replace, 1);
  EXPECT_THAT(s.contents, UnorderedElementsAre(Pair("glb", 2), Pair("b3dm", 1), Pair("tileset", 2)));
  EXPECT_EQ(s.content_files, 2);
  EXPECT_EQ(s.content_files_missing, 1);
  EXPECT_EQ(s.content_bytes, 5);
  EXPECT_EQ(s.external_tilesets, 1);
  ASSERT_EQ(s.depth(), 4);
  EXPECT_EQ(s.levels[1].tiles, 3);
  EXPECT_EQ(s.levels[1].geometric_error_min_m, 2);
  EXPECT_EQ(s.levels[1].geometric_error_max_m, 4);
  EXPECT_THAT(s.extensions_unsupported, ElementsAre("Y"));
  EXPECT_THAT(s.attribution, ElementsAre("A", "B"));
  EXPECT_THAT(s.failures, ElementsAre(HasSubstr("tile root/2: none.json: is missing")));
  EXPECT_FALSE(s.georeferenced);
  EXPECT_EQ(s.bounds_local.max(), geometry::Vec3(10, 20, 30));
  EXPECT_EQ(source.reads().count("a.glb"), 0U);
}

TEST(InspectTileset, machangara) {
  TILEFLIGHT_REQUIRE_TEST_DATA(folder, "tilesets/machangara_photogrammetry");
  const TilesetSummary s = inspect_tileset(folder.string());
  EXPECT_EQ(s.contents.at("b3dm"), 637);
  EXPECT_EQ(s.leaves, 462);
  EXPECT_EQ(s.content_files_missing, 0);
  EXPECT_FALSE(s.georeferenced);
  // Its own frame is that of the survey, not the one that puts its middle at 0.
  EXPECT_NEAR(s.bounds_local.center().x(), 347.79, 0.01);
  EXPECT_NEAR(s.bounds_local.center().z(), 2891.59, 0.01);
}

TEST(InspectTileset, georeferenced) {
  TILEFLIGHT_REQUIRE_TEST_DATA(folder, "tilesets/paphos_agora_meshopt");
  const TilesetSummary s = inspect_tileset(folder.string());
  EXPECT_TRUE(s.georeferenced);
  EXPECT_NEAR(s.center->latitude_deg, 34.76, 0.01);  // Nea Paphos, Cyprus
  EXPECT_NEAR(s.center->longitude_deg, 32.41, 0.01);
}

TEST(InspectTileset, implicit_tiling_is_counted) {
  TILEFLIGHT_REQUIRE_TEST_DATA(folder, "tilesets/cesium_3d_tiles_samples/1.1/SparseImplicitQuadtree");
  const TilesetSummary s = inspect_tileset(folder.string());
  EXPECT_EQ(s.tiles_unsupported, 0);
  EXPECT_EQ(s.subtrees, 9);
  EXPECT_EQ(s.depth(), 6);
  EXPECT_EQ(s.contents.at("glb"), 32);
  EXPECT_EQ(s.content_files_missing, 0);
}

}  // namespace
}  // namespace tileflight::tiles
