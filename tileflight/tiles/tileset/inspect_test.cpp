#include "tileflight/tiles/tileset/inspect.h"

#include <gmock/gmock.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "tests/test_data.h"
#include "tileflight/tiles/fetch/test_tilesets.h"
#include "tileflight/tiles/tile_content/attribution.h"
#include "tileflight/tiles/tileset/cut_reader.h"

namespace tileflight::tileset::inspect_test {
namespace {

using fetch::test_support::box_volume;
using fetch::test_support::Json;
using fetch::test_support::MemorySource;
using fetch::test_support::tile;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::Pair;
using ::testing::UnorderedElementsAre;

TEST(InspectTileset, NamesAPlaceWithoutTextures) {
  for (const bool colors : {false, true}) {
    fetch::test_support::GltfWriter writer;
    fetch::test_support::Json attributes = {
        {"POSITION", writer.add_accessor(std::vector<float>{0, 0, 0, 1, 0, 0, 0, 1, 0}, 3)}};
    if (colors) attributes["COLOR_0"] = writer.add_accessor(std::vector<std::uint8_t>(9, 100), 3, true);
    writer.add_primitive({{"attributes", attributes}});
    fetch::test_support::MemorySource source(fetch::test_support::tileset(
        fetch::test_support::tile({{"box", {0, 0, 0, 2, 0, 0, 0, 2, 0, 0, 0, 2}}}, 0, "a.glb")));
    source.add("a.glb", writer.glb());
    const std::vector<std::string> warnings = inspect_tileset(source).warnings;
    EXPECT_EQ(std::count(warnings.begin(), warnings.end(), kNoTextures), colors ? 0 : 1);
    TilesetTree tree(source);
    const TileCut cut = select_cut(tree, region_criterion({{0, 0, 0}, {4, 4, 4}}, geometry::SE3(), 0.0));
    EXPECT_EQ(lacks_textures(source, tree, cut.contents, geometry::SE3()), !colors);
    EXPECT_FALSE(lacks_textures(source, tree, {}, geometry::SE3()));
  }
}

TEST(InspectTileset, NamesContentsOfAKindThatIsNotRead) {
  Json root = tile(box_volume(0, 0, 0, 2, 2, 2), 8, "a.vctr");
  root["children"] = {tile(box_volume(0, 0, 0, 1, 1, 1), 0, "b.vctr"), tile(box_volume(0, 0, 0, 1, 1, 1), 0, "c.glb")};
  MemorySource source(fetch::test_support::tileset(root));
  for (const char* name : {"a.vctr", "b.vctr"}) source.add(name, "vctr");
  source.add("c.glb", fetch::test_support::triangle_glb({0, 0, 0, 1, 0, 0, 0, 1, 0}));
  const std::vector<std::string> warnings = inspect_tileset(source).warnings;
  EXPECT_THAT(warnings, ::testing::Contains(HasSubstr("2 contents are of the kind vctr, which is not read")));
  EXPECT_THAT(warnings, ::testing::Not(::testing::Contains(HasSubstr("kind glb"))));
}

TEST(InspectTileset, CountsWhatIsThere) {
  Json root = fetch::test_support::tile(fetch::test_support::box_volume(0, 0, 0, 10, 20, 30), 8);
  root["children"] = {fetch::test_support::tile(fetch::test_support::box_volume(0, 0, 0, 1, 1, 1), 4, "a.glb"),
                      fetch::test_support::tile(fetch::test_support::box_volume(0, 0, 0, 1, 1, 1), 2, "t.json"),
                      fetch::test_support::tile(fetch::test_support::box_volume(0, 0, 0, 1, 1, 1), 3, "none.json")};
  Json json = fetch::test_support::tileset(root);
  json["asset"]["copyright"] = "A";
  json["extensionsUsed"] = {"X", "Y"};
  json["extensionsRequired"] = {"Y"};
  MemorySource source(json);
  Json inner = fetch::test_support::tile(fetch::test_support::box_volume(0, 0, 0, 1, 1, 1), 1, "a.glb");
  inner["refine"] = "ADD";
  inner["children"] =
      Json::array({fetch::test_support::tile(fetch::test_support::box_volume(0, 0, 0, 1, 1, 1), 0, "b.b3dm")});
  Json external = fetch::test_support::tileset(inner);
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
  EXPECT_EQ(s.contents_read, 1) << "the other is missing";
}

/// A GLB of this JSON alone.
std::string glb(std::string json) {
  while (json.size() % 4 != 0) json += ' ';
  const auto number = [](std::size_t value) {
    std::string bytes;
    for (int shift = 0; shift < 32; shift += 8) bytes += static_cast<char>(value >> shift & 0xffU);
    return bytes;
  };
  return "glTF" + number(2) + number(20 + json.size()) + number(json.size()) + "JSON" + json;
}

std::string with_copyright(const std::string& holder) {
  return Json{{"asset", {{"version", "2.0"}, {"copyright", holder}}}}.dump();
}

TEST(InspectTileset, AttributionIsThatOfTilesToo) {
  Json root = fetch::test_support::tile(fetch::test_support::box_volume(0, 0, 0, 10, 20, 30), 8, "root.glb");
  root["children"] = {fetch::test_support::tile(fetch::test_support::box_volume(0, 0, 0, 1, 1, 1), 4, "b.b3dm"),
                      fetch::test_support::tile(fetch::test_support::box_volume(0, 0, 0, 1, 1, 1), 2, "c.gltf"),
                      fetch::test_support::tile(fetch::test_support::box_volume(0, 0, 0, 1, 1, 1), 2, "broken.glb")};
  MemorySource source(fetch::test_support::tileset(root));
  source.add("root.glb", glb(with_copyright("Survey; City")));
  source.add("b.b3dm", "b3dm, whose header and tables do not matter here" + glb(with_copyright("City")));
  source.add("c.gltf", with_copyright("Other"));
  source.add("broken.glb", "glTF" + std::string(30, 'x') + glb("{\"asset\": {\"copyright\": 7}}"));
  const TilesetSummary s = inspect_tileset(source);
  EXPECT_THAT(s.attribution, ElementsAre("City", "Other", "Survey"));
  EXPECT_EQ(s.contents_read, 4);
}

TEST(InspectTileset, AttributionIsOfASampleWhereThereAreManyTiles) {
  Json root = fetch::test_support::tile(fetch::test_support::box_volume(0, 0, 0, 10, 20, 30), 8, "root.glb");
  root["children"] = Json::array();
  MemorySource source;
  for (int i = 0; i < 1000; ++i) {
    const std::string uri = std::to_string(i) + ".glb";
    root["children"].push_back(fetch::test_support::tile(fetch::test_support::box_volume(0, 0, 0, 1, 1, 1), 0, uri));
    source.add(uri, glb(with_copyright("City")));
  }
  source.add("root.glb", glb(with_copyright("Root")));
  source.add("tileset.json", fetch::test_support::tileset(root).dump());
  const TilesetSummary s = inspect_tileset(source);
  EXPECT_THAT(s.attribution, ElementsAre("City", "Root"));
  EXPECT_EQ(s.contents_read, 64);
  EXPECT_EQ(s.content_files, 1001);
}

TEST(CopyrightsIn, SurviveEveryCutOfATile) {
  const std::string whole = "b3dm" + std::string(24, '\0') + glb(with_copyright("A"));
  const auto bytes = std::as_bytes(std::span(whole.data(), whole.size()));
  EXPECT_THAT(tile_content::find_copyrights(bytes), ElementsAre("A"));
  for (std::size_t size = 0; size < whole.size(); ++size) tile_content::find_copyrights(bytes.first(size));
}

/// A source with latency that records what it was asked to read.
class SlowSource : public MemorySource {
 public:
  using MemorySource::MemorySource;
  bool prefetch(const std::vector<std::string>& uris) override {
    if (!uris.empty()) announced.push_back(uris);
    return true;
  }
  std::vector<std::vector<std::string>> announced;
};

TEST(InspectTileset, ExternalTilesetsOfALevelAreAskedForTogether) {
  const Json volume = fetch::test_support::box_volume(0, 0, 0, 1, 1, 1);
  Json root = fetch::test_support::tile(volume, 8);
  root["children"] = {fetch::test_support::tile(volume, 4, "a.json"), fetch::test_support::tile(volume, 4, "gone.json"),
                      fetch::test_support::tile(volume, 4, "b.json")};
  SlowSource source(fetch::test_support::tileset(root));
  source.add("a.json", fetch::test_support::tileset(fetch::test_support::tile(volume, 2, "c.json")).dump());
  source.add("b.json", fetch::test_support::tileset(fetch::test_support::tile(volume, 2, "d.json")).dump());
  for (const char* name : {"c.json", "d.json"})
    source.add(name, fetch::test_support::tileset(fetch::test_support::tile(volume, 1, "e.glb")).dump());
  const TilesetSummary s = inspect_tileset(source);
  EXPECT_EQ(s.external_tilesets, 4);
  EXPECT_EQ(s.tiles, 8);
  EXPECT_THAT(s.failures, ElementsAre(HasSubstr("gone.json: is missing")));
  ASSERT_EQ(source.announced.size(), 2U);
  EXPECT_THAT(source.announced[0], UnorderedElementsAre("a.json", "gone.json", "b.json"));
  EXPECT_THAT(source.announced[1], UnorderedElementsAre("c.json", "d.json"));
}

/// A place of `count` external tilesets, each named by its number; each has one to five leaves below its root.
class ManyTilesets : public MemorySource {
 public:
  explicit ManyTilesets(int count, bool same_file = false) {
    const Json volume = fetch::test_support::box_volume(0, 0, 0, 1, 1, 1);
    Json root = fetch::test_support::tile(volume, 8);
    root["children"] = Json::array();
    for (int i = 0; i < count; ++i) {
      const int number = same_file ? 5 : i;
      const std::string name = std::to_string(number);
      root["children"].push_back(fetch::test_support::tile(volume, 4, name + ".json"));
      Json top = fetch::test_support::tile(volume, 2, name + ".glb");
      top["refine"] = "REPLACE";
      for (int leaf = 0; leaf <= (number * 7919 >> 7) % 5; ++leaf) {
        const std::string uri = name + "-" + std::to_string(leaf) + ".glb";
        top["children"].push_back(fetch::test_support::tile(volume, 0, uri));
        add(uri, fetch::test_support::triangle_glb());
      }
      add(name + ".glb", fetch::test_support::triangle_glb());
      add(name + ".json", fetch::test_support::tileset(top).dump());
    }
    add("tileset.json", fetch::test_support::tileset(root).dump());
  }

  std::int64_t tilesets_read() const {
    return std::ranges::count_if(reads(), [](const auto& file) { return file.first.ends_with(".json"); }) - 1;
  }
};

TEST(InspectTileset, OfManyTilesetsSomeStandForAllAndItSaysSo) {
  ManyTilesets source(500);
  const TilesetSummary all = inspect_tileset(source, {.all = true, .max_nested_files = 40});
  EXPECT_FALSE(all.is_estimate);
  EXPECT_EQ(all.tiles, 1 + 500 + 500 + 1503);
  EXPECT_EQ(all.finest_contents, 1503);
  EXPECT_EQ(all.nested_files_opened, 500);
  EXPECT_EQ(all.count_spread, 0.0);

  ManyTilesets again(500);
  const TilesetSummary some = inspect_tileset(again, {.max_nested_files = 40});
  EXPECT_TRUE(some.is_estimate);
  EXPECT_EQ(some.nested_files, 500);
  EXPECT_EQ(some.nested_files_opened, 40);
  EXPECT_EQ(again.tilesets_read(), 40);
  EXPECT_EQ(some.external_tilesets, 40) << "those opened";
  EXPECT_GT(some.count_spread, 0.0);
  EXPECT_LT(some.count_spread, 0.5);
  const auto near = [&](std::int64_t number, double truth) {
    return std::abs(static_cast<double>(number) - truth) <= some.count_spread * truth;
  };
  EXPECT_TRUE(near(some.finest_contents, 1503)) << some.finest_contents;
  EXPECT_TRUE(near(some.tiles, 2504)) << some.tiles;
  EXPECT_TRUE(near(some.content_files, 2003)) << some.content_files;
  EXPECT_TRUE(near(some.content_bytes, static_cast<double>(all.content_bytes))) << some.content_bytes;
  EXPECT_EQ(some.levels[1].tiles, 500) << "of the file that was read";
  EXPECT_EQ(some.levels[2].tiles, 500) << "each tileset has one root";
  EXPECT_EQ(some.probes.size(), 40U);
}

TEST(InspectTileset, OneTilesetNamedOftenIsOneFile) {
  ManyTilesets source(500, true);
  const TilesetSummary some = inspect_tileset(source, {.max_nested_files = 20});
  EXPECT_TRUE(some.is_estimate);
  EXPECT_EQ(some.tiles, 1 + 500 + 500 + 2500);
  EXPECT_EQ(some.content_files, 6);
  EXPECT_EQ(some.finest_contents, 2500);
  EXPECT_NEAR(some.count_spread, 0.0, 1e-12);
}

/// 64 x 64 subtrees of 85 tiles below a root subtree, of which a few are opened.
TEST(InspectTileset, OfManySubtreesSomeStandForAll) {
  MemorySource source;
  Json root =
      fetch::test_support::tile(fetch::test_support::box_volume(0, 0, 0, 64, 64, 64), 64, "{level}.{x}.{y}.glb");
  root["refine"] = "REPLACE";
  root["implicitTiling"] = {{"subdivisionScheme", "QUADTREE"},
                            {"subtreeLevels", 6},
                            {"availableLevels", 10},
                            {"subtrees", {{"uri", "{level}.{x}.{y}.subtree"}}}};
  source.add("tileset.json", fetch::test_support::tileset(root).dump());
  const std::string full =
      R"({"tileAvailability":{"constant":1},"contentAvailability":[{"constant":1}],"childSubtreeAvailability":{"constant":1}})";
  source.add("0.0.0.subtree", full);
  for (int x = 0; x < 64; ++x) {
    for (int y = 0; y < 64; ++y) source.add("6." + std::to_string(x) + "." + std::to_string(y) + ".subtree", full);
  }
  const TilesetSummary s = inspect_tileset(source, {.max_nested_files = 50});
  EXPECT_TRUE(s.is_estimate);
  EXPECT_EQ(s.nested_files, 1 + 4096);
  EXPECT_EQ(s.nested_files_opened, 1 + 49);
  EXPECT_EQ(s.tiles, (1 << 20) / 3) << "(4^10 - 1) / 3";
  EXPECT_EQ(s.finest_contents, 1 << 18);
  EXPECT_NEAR(s.count_spread, 0.0, 1e-12);
}

TEST(InspectTileset, Machangara) {
  TILEFLIGHT_REQUIRE_TEST_DATA(folder, "tilesets/machangara_photogrammetry");
  const TilesetSummary s = inspect_tileset(folder.string());
  EXPECT_EQ(s.contents.at("b3dm"), 637);
  EXPECT_EQ(s.leaves, 462);
  EXPECT_EQ(s.content_files_missing, 0);
  EXPECT_FALSE(s.georeferenced);
  // Its own frame is that of the survey, not the one whose origin is its centre.
  EXPECT_NEAR(s.bounds_local.center().x(), 347.79, 0.01);
  EXPECT_NEAR(s.bounds_local.center().z(), 2891.59, 0.01);
}

TEST(InspectTileset, Georeferenced) {
  TILEFLIGHT_REQUIRE_TEST_DATA(folder, "tilesets/paphos_agora_meshopt");
  const TilesetSummary s = inspect_tileset(folder.string());
  EXPECT_TRUE(s.georeferenced);
  EXPECT_NEAR(s.center->latitude_deg, 34.76, 0.01);  // Nea Paphos, Cyprus
  EXPECT_NEAR(s.center->longitude_deg, 32.41, 0.01);
}

TEST(InspectTileset, ImplicitTilingIsCounted) {
  TILEFLIGHT_REQUIRE_TEST_DATA(folder, "tilesets/cesium_3d_tiles_samples/1.1/SparseImplicitQuadtree");
  const TilesetSummary s = inspect_tileset(folder.string());
  EXPECT_EQ(s.tiles_unsupported, 0);
  EXPECT_EQ(s.subtrees, 9);
  EXPECT_EQ(s.depth(), 6);
  EXPECT_EQ(s.contents.at("glb"), 32);
  EXPECT_EQ(s.content_files_missing, 0);
}

TEST(InspectTileset, AFullQuadtreeBefore11) {
  TILEFLIGHT_REQUIRE_TEST_DATA(folder, "tilesets/cesiumjs_specs_data/FullQuadtree");
  const TilesetSummary s = inspect_tileset(folder.string());
  EXPECT_EQ(s.subtrees, 1);
  ASSERT_EQ(s.depth(), 3);
  EXPECT_EQ(s.levels[2].tiles, 16);
  EXPECT_EQ(s.leaves, 16);
  EXPECT_EQ(s.contents.at("b3dm"), 21);
  EXPECT_EQ(s.content_files, 21);
  EXPECT_EQ(s.content_files_missing, 0);
  EXPECT_EQ(s.levels[2].geometric_error_max_m, 1250);
}

}  // namespace
}  // namespace tileflight::tileset::inspect_test
