#include "tileflight/tiles/implicit_tiling.h"

#include <gmock/gmock.h>

#include <cmath>
#include <functional>
#include <nlohmann/json.hpp>
#include <random>

#include "tests/test_data.h"
#include "tileflight/tiles/inspect.h"
#include "tileflight/tiles/load.h"
#include "tileflight/tiles/selection.h"
#include "tileflight/tiles/subtree.h"
#include "tileflight/transport/test_tilesets.h"

namespace tileflight::tiles::implicit_tiling_test {
namespace {

using base::test_support::error_of;
using base::test_support::to_bytes;
using geometry::Vec3;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using transport::test_support::Bytes;
using transport::test_support::Json;
using transport::test_support::MemorySource;

ImplicitTiling box_tiling(bool octree, std::uint32_t subtree_levels = 2, std::uint32_t available_levels = 4) {
  ImplicitTiling tiling;
  tiling.octree = octree;
  tiling.subtree_levels = subtree_levels;
  tiling.available_levels = available_levels;
  tiling.subtree_template = octree ? "s/{level}.{x}.{y}.{z}.subtree" : "s/{level}.{x}.{y}.subtree";
  tiling.content_templates = {"a/{level}.{x}.{y}.glb"};
  OrientedBox box;
  box.half_axes = Vec3(8, 8, 4).asDiagonal();
  tiling.root_volume = box;
  tiling.root_geometric_error_m = 16;
  return tiling;
}

ImplicitSubtree place_of(const ImplicitTiling& tiling, const TileCoordinates& root = {}) {
  return {std::make_shared<const ImplicitTiling>(tiling), root};
}

/// All tiles of a subtree, breadth first.
struct ExpandedTile : SubtreeTile {
  std::vector<std::uint32_t> children;    ///< places in the list
  std::vector<TileCoordinates> subtrees;  ///< roots of child subtrees
};

std::vector<ExpandedTile> expand(const Subtree& subtree) {
  std::vector<std::uint32_t> indices{0};
  std::vector<ExpandedTile> tiles;
  for (std::size_t i = 0; i < indices.size(); ++i) {
    ExpandedTile tile{subtree.tile(indices[i]), {}, {}};
    for (const std::uint32_t child : subtree.children(indices[i])) {
      if (subtree.is_child_subtree(child)) {
        tile.subtrees.push_back(subtree.coordinates(child));
      } else {
        tile.children.push_back(static_cast<std::uint32_t>(indices.size()));
        indices.push_back(child);
      }
    }
    tiles.push_back(std::move(tile));
  }
  EXPECT_EQ(tiles.size(), subtree.tile_count());
  return tiles;
}

Subtree parse(const std::string& bytes, const ImplicitTiling& tiling, const TileCoordinates& root = {}) {
  return parse_subtree(base::test_support::to_bytes(bytes), place_of(tiling, root), "s");
}

TEST(ImplicitTiling, ABoxIsDividedIntoHalves) {
  const ImplicitTiling quadtree = box_tiling(false);
  const auto box = std::get<OrientedBox>(implicit_volume(quadtree, {2, {3, 0, 0}}));
  EXPECT_LT((box.center - Vec3(6, -6, 0)).norm(), 1e-12);
  EXPECT_LT((box.half_axes.diagonal() - Vec3(2, 2, 4)).norm(), 1e-12);  // a quadtree does not divide the height
  const auto cell = std::get<OrientedBox>(implicit_volume(box_tiling(true), {1, {0, 1, 1}}));
  EXPECT_LT((cell.center - Vec3(-4, 4, 2)).norm(), 1e-12);
  EXPECT_LT((cell.half_axes.diagonal() - Vec3(4, 4, 2)).norm(), 1e-12);
  EXPECT_DOUBLE_EQ(implicit_geometric_error_m(quadtree, {3, {}}), 2.0);
}

/// The children of a tile cover it without gaps or overlaps, also across the antimeridian.
TEST(ImplicitTiling, ARegionIsDividedAcrossTheAntimeridian) {
  ImplicitTiling tiling = box_tiling(true);
  tiling.root_volume = GeographicRegion{3.0, 0.5, -3.0, 0.7, -10, 30};
  const auto west = std::get<GeographicRegion>(implicit_volume(tiling, {1, {0, 0, 0}}));
  const auto east = std::get<GeographicRegion>(implicit_volume(tiling, {1, {1, 1, 1}}));
  EXPECT_DOUBLE_EQ(west.west_rad, 3.0);
  EXPECT_NEAR(west.east_rad, M_PI, 1e-12);
  EXPECT_NEAR(std::abs(east.west_rad), M_PI, 1e-12);
  EXPECT_NEAR(east.east_rad, -3.0, 1e-12);
  EXPECT_NEAR(west.north_rad, 0.6, 1e-12);
  EXPECT_NEAR(east.south_rad, 0.6, 1e-12);
  EXPECT_NEAR(west.max_height_m, 10, 1e-12);
  EXPECT_NEAR(east.min_height_m, 10, 1e-12);
}

TEST(ImplicitTiling, Templates) {
  const ImplicitTiling quadtree = box_tiling(false);
  EXPECT_EQ(expand_template("{level}/{x}/{y}.glb", quadtree, {4, {11, 2, 0}}, "t"), "4/11/2.glb");
  EXPECT_EQ(expand_template("{z}{x", box_tiling(true), {4, {11, 2, 7}}, "t"), "7{x");
  EXPECT_THAT(base::test_support::error_of([&] { expand_template("{z}.glb", quadtree, {}, "t"); }),
              HasSubstr("the unknown variable {z}"));
  EXPECT_THAT(base::test_support::error_of([&] { expand_template("{lod}.glb", quadtree, {}, "t"); }),
              HasSubstr("the unknown variable {lod}"));
}

/// Two levels of a quadtree, bits in Morton order: the root, its children (1, 0) and (0, 1), and of the sixteen child
/// subtrees the one at (3, 1) and the one at (1, 2).
Json two_levels() {
  return {
      {"buffers", {{{"byteLength", 16}}}},
      {"bufferViews",
       {{{"buffer", 0}, {"byteOffset", 0}, {"byteLength", 1}}, {{"buffer", 0}, {"byteOffset", 8}, {"byteLength", 2}}}},
      {"tileAvailability", {{"bitstream", 0}, {"availableCount", 3}}},
      {"contentAvailability", {{{"constant", 1}}}},
      {"childSubtreeAvailability", {{"bitstream", 1}}}};
}

std::string two_levels_binary() {
  std::string binary(16, '\0');
  binary[0] = 0b01101;  // root, child 1 (x), child 2 (y)
  // Child subtrees in Morton order of two levels: (3, 1) is 0b0111 = 7, (1, 2) is 0b1001 = 9.
  binary[8] = static_cast<char>(1 << 7);
  binary[9] = 1 << 1;
  return binary;
}

void expect_two_levels(const Subtree& parsed) {
  const std::vector<ExpandedTile> tiles = expand(parsed);
  ASSERT_EQ(tiles.size(), 3U);
  EXPECT_THAT(tiles[0].children, ElementsAre(1U, 2U));
  EXPECT_THAT(tiles[1].coordinates.xyz, ElementsAre(1, 0, 0));
  EXPECT_THAT(tiles[2].coordinates.xyz, ElementsAre(0, 1, 0));
  ASSERT_EQ(tiles[1].subtrees.size(), 1U);
  EXPECT_EQ(tiles[1].subtrees[0].level, 2U);
  EXPECT_THAT(tiles[1].subtrees[0].xyz, ElementsAre(3, 1, 0));
  ASSERT_EQ(tiles[2].subtrees.size(), 1U);
  EXPECT_THAT(tiles[2].subtrees[0].xyz, ElementsAre(1, 2, 0));
  EXPECT_EQ(tiles[0].contents.size(), 1U);
  EXPECT_DOUBLE_EQ(tiles[2].geometric_error_m, 8.0);
}

TEST(Subtree, BitsAreInMortonOrder) {
  expect_two_levels(parse(transport::test_support::subtree(two_levels(), two_levels_binary()), box_tiling(false)));
}

TEST(Subtree, AsJsonWithABufferBesideIt) {
  Json json = two_levels();
  json["buffers"][0]["uri"] = "bits.bin";
  const auto read = [](const std::string& uri) {
    EXPECT_EQ(uri, "bits.bin");
    return base::test_support::to_bytes(two_levels_binary());
  };
  expect_two_levels(parse_subtree(base::test_support::to_bytes(json.dump()), place_of(box_tiling(false)), "s", read));
  EXPECT_THAT(base::test_support::error_of([&] { parse(json.dump(), box_tiling(false)); }),
              HasSubstr("refers to another file"));
}

TEST(Subtree, AsBefore11) {
  Json json = two_levels();
  json["tileAvailability"] = {{"bufferView", 0}};
  json["childSubtreeAvailability"] = {{"bufferView", 1}};
  json["contentAvailability"] = {{"constant", 1}};
  expect_two_levels(parse(transport::test_support::subtree(json, two_levels_binary()), box_tiling(false)));
}

TEST(Subtree, EndsWhereTheTreeEnds) {
  const ImplicitTiling shallow = box_tiling(false, 2, 1);
  Json json = {{"tileAvailability", {{"constant", 1}}}, {"childSubtreeAvailability", {{"constant", 1}}}};
  EXPECT_EQ(expand(parse(json.dump(), shallow)).size(), 1U);
  EXPECT_TRUE(expand(parse(json.dump(), shallow))[0].subtrees.empty());
  EXPECT_EQ(expand(parse(json.dump(), box_tiling(true))).size(), 9U);
  EXPECT_EQ(expand(parse(json.dump(), box_tiling(true)))[8].subtrees.size(), 8U);
}

TEST(Subtree, SeveralContents) {
  ImplicitTiling tiling = box_tiling(false);
  tiling.content_templates.push_back("b/{level}.{x}.{y}.glb");
  Json json = two_levels();
  json["contentAvailability"] = {{{"constant", 0}}, {{"bitstream", 0}}};
  const std::vector<ExpandedTile> read =
      expand(parse(transport::test_support::subtree(json, two_levels_binary()), tiling));
  ASSERT_EQ(read.size(), 3U);
  for (const SubtreeTile& tile : read) {
    ASSERT_EQ(tile.contents.size(), 1U);
    EXPECT_EQ(tile.contents[0].template_index, 1U);
  }
}

TEST(Subtree, MetadataGiveVolumesAndErrors) {
  ImplicitTiling tiling = box_tiling(false);
  const Json schema = {
      {"classes",
       {{"tile",
         {{"properties",
           {{"box",
             {{"type", "SCALAR"},
              {"componentType", "FLOAT64"},
              {"array", true},
              {"count", 12},
              {"semantic", "TILE_BOUNDING_BOX"}}},
            {"error", {{"type", "SCALAR"}, {"componentType", "UINT8"}, {"semantic", "TILE_GEOMETRIC_ERROR"}}},
            {"refine", {{"type", "SCALAR"}, {"componentType", "UINT8"}, {"semantic", "TILE_REFINE"}}}}}}},
        {"content", {{"properties", {{"uri", {{"type", "STRING"}, {"semantic", "CONTENT_URI"}}}}}}}}}};
  tiling.schema =
      std::make_shared<const tile_contents::MetadataSchema>(tile_contents::parse_metadata_schema(schema, "schema"));
  std::vector<double> boxes;
  for (const double x : {0.0, 4.0, -4.0}) {
    for (const double v : {x, 0.0, 1.0, 1.0, 0.0, 0.0, 0.0, 2.0, 0.0, 0.0, 0.0, 3.0}) boxes.push_back(v);
  }
  std::string binary = two_levels_binary() + base::test_support::to_raw_bytes(boxes);
  Json json = two_levels();
  const auto add_view = [&](const std::string& bytes) {
    json["bufferViews"].push_back({{"buffer", 0}, {"byteOffset", binary.size()}, {"byteLength", bytes.size()}});
    binary += bytes;
    return json["bufferViews"].size() - 1;
  };
  json["bufferViews"].push_back({{"buffer", 0}, {"byteOffset", 16}, {"byteLength", boxes.size() * 8}});
  json["contentAvailability"] = {{{"bitstream", 0}}};
  json["tileMetadata"] = 0;
  json["contentMetadata"] = {1};
  const auto errors = add_view({'\x0a', '\x05', '\x04'});
  const auto refine = add_view({'\x00', '\x01', '\x01'});
  const auto uris = add_view("root.glbx1.glby1.glb");
  const auto ends = add_view(base::test_support::to_raw_bytes<std::uint32_t>({0, 8, 14, 20}));
  json["propertyTables"] = {
      {{"class", "tile"},
       {"count", 3},
       {"properties", {{"box", {{"values", 2}}}, {"error", {{"values", errors}}}, {"refine", {{"values", refine}}}}}},
      {{"class", "content"}, {"count", 3}, {"properties", {{"uri", {{"values", uris}, {"stringOffsets", ends}}}}}}};
  json["buffers"][0]["byteLength"] = binary.size();
  const std::vector<ExpandedTile> read = expand(parse(transport::test_support::subtree(json, binary), tiling));
  ASSERT_EQ(read.size(), 3U);
  const auto box = std::get<OrientedBox>(read[2].bounding_volume);
  EXPECT_LT((box.center - Vec3(-4, 0, 1)).norm(), 1e-12);
  EXPECT_LT((box.half_axes.diagonal() - Vec3(1, 2, 3)).norm(), 1e-12);
  EXPECT_DOUBLE_EQ(read[0].geometric_error_m, 10);
  EXPECT_DOUBLE_EQ(read[2].geometric_error_m, 4);
  EXPECT_EQ(read[0].refine, Refine::kAdd);
  EXPECT_EQ(read[1].refine, Refine::kReplace);
  EXPECT_EQ(read[1].contents[0].uri, "x1.glb");
}

/// A subtree of random bits, against its definition: children have the indices after their siblings', and their
/// coordinates follow from the parents'.
TEST(Subtree, TilesMadeOneByOneAreThoseOfTheDefinition) {
  for (const bool octree : {false, true}) {
    const std::uint32_t levels = octree ? 4 : 5, children = octree ? 8 : 4;
    const ImplicitTiling tiling = box_tiling(octree, levels, 12);
    std::vector<std::size_t> start{0};
    for (std::uint32_t level = 0; level < levels; ++level)
      start.push_back(start.back() + (std::size_t{1} << (level * (octree ? 3 : 2))));
    std::mt19937 random(5);
    const auto bits = [&](std::size_t count) {
      std::string bytes((count + 7) / 8, '\0');
      for (char& byte : bytes) byte = static_cast<char>(random() | random());
      bytes[0] = static_cast<char>(bytes[0] | 1);
      return bytes;
    };
    const std::string available = bits(start.back()), contents = bits(start.back()),
                      below = bits(start.back() * children);
    const auto bit = [](const std::string& bytes, std::size_t i) {
      return (static_cast<unsigned char>(bytes[i / 8]) >> (i % 8) & 1U) != 0;
    };
    Json json;
    std::string binary;
    for (const std::string& part : {available, contents, below}) {
      json["bufferViews"].push_back({{"buffer", 0}, {"byteOffset", binary.size()}, {"byteLength", part.size()}});
      binary += part;
    }
    json["buffers"] = {{{"byteLength", binary.size()}}};
    json["tileAvailability"] = {{"bitstream", 0}};
    json["contentAvailability"] = {{{"bitstream", 1}}};
    json["childSubtreeAvailability"] = {{"bitstream", 2}};
    const TileCoordinates root{3, {5, 2, octree ? 7U : 0U}};
    const Subtree read = parse(transport::test_support::subtree(json, binary), tiling, root);

    std::size_t tiles = 0, subtrees = 0;
    const std::function<void(std::size_t, std::uint32_t, const TileCoordinates&)> visit =
        [&](std::size_t in_level, std::uint32_t level, const TileCoordinates& at) {
          const auto index = static_cast<std::uint32_t>(start[level] + in_level);
          ++(level == levels ? subtrees : tiles);
          EXPECT_EQ(read.is_child_subtree(index), level == levels);
          EXPECT_EQ(read.coordinates(index).level, at.level);
          EXPECT_EQ(read.coordinates(index).xyz, at.xyz);
          if (level == levels) return;
          EXPECT_EQ(read.tile(index).contents.size(), bit(contents, index) ? 1U : 0U);
          std::vector<std::uint32_t> found = read.children(index), wanted;
          for (std::uint32_t child = 0; child < children; ++child) {
            const std::size_t place = in_level * children + child;
            if (!(level + 1 == levels ? bit(below, place) : bit(available, start[level + 1] + place))) continue;
            wanted.push_back(static_cast<std::uint32_t>(start[level + 1] + place));
            visit(place, level + 1, child_coordinates(at, child));
          }
          EXPECT_EQ(found, wanted);
        };
    visit(0, 0, root);
    EXPECT_EQ(tiles, read.tile_count());
    EXPECT_GT(tiles, 100U);
    EXPECT_GT(subtrees, 100U);
  }
}

/// Of 341 tiles some are not there; each one's error is its row's.
TEST(Subtree, RowsOfMetadataCountTheTilesThatAreThere) {
  ImplicitTiling tiling = box_tiling(false, 5, 5);
  tiling.schema = std::make_shared<const tile_contents::MetadataSchema>(tile_contents::parse_metadata_schema(
      {{"classes",
        {{"tile",
          {{"properties",
            {{"error", {{"type", "SCALAR"}, {"componentType", "UINT16"}, {"semantic", "TILE_GEOMETRIC_ERROR"}}}}}}}}}},
      "schema"));
  std::string binary(43, '\xff');
  for (std::size_t byte = 1; byte < binary.size(); byte += 3) binary[byte] = '\x5b';
  std::vector<std::uint16_t> rows;
  for (std::size_t i = 0; i < 344; ++i) {
    if ((static_cast<unsigned char>(binary[i / 8]) >> (i % 8) & 1U) != 0)
      rows.push_back(static_cast<std::uint16_t>(rows.size()));
  }
  binary += std::string(5, '\0') + base::test_support::to_raw_bytes(rows);
  const Json json = {
      {"buffers", {{{"byteLength", binary.size()}}}},
      {"bufferViews",
       {{{"buffer", 0}, {"byteOffset", 0}, {"byteLength", 43}},
        {{"buffer", 0}, {"byteOffset", 48}, {"byteLength", rows.size() * 2}}}},
      {"tileAvailability", {{"bitstream", 0}}},
      {"childSubtreeAvailability", {{"constant", 0}}},
      {"tileMetadata", 0},
      {"propertyTables", {{{"class", "tile"}, {"count", rows.size()}, {"properties", {{"error", {{"values", 1}}}}}}}}};
  const Subtree read = parse(transport::test_support::subtree(json, binary), tiling);
  std::vector<std::uint32_t> pending{0};
  while (!pending.empty()) {
    const std::uint32_t index = pending.back();
    pending.pop_back();
    std::size_t before = 0;
    for (std::size_t i = 0; i < index; ++i) before += static_cast<unsigned char>(binary[i / 8]) >> (i % 8) & 1U;
    EXPECT_EQ(read.tile(index).geometric_error_m, static_cast<double>(before)) << index;
    for (const std::uint32_t child : read.children(index)) pending.push_back(child);
  }
}

TEST(Subtree, FaultsAreNamed) {
  const auto message = [](const std::function<void(Json&)>& change) {
    Json json = two_levels();
    change(json);
    return base::test_support::error_of(
        [&] { parse(transport::test_support::subtree(json, two_levels_binary()), box_tiling(false)); });
  };
  EXPECT_EQ(message([](Json&) {}), "");
  EXPECT_THAT(message([](Json& j) { j.erase("tileAvailability"); }), HasSubstr("tileAvailability is missing"));
  EXPECT_THAT(message([](Json& j) { j["tileAvailability"] = Json::object(); }), HasSubstr("no bitstream and no"));
  EXPECT_THAT(message([](Json& j) { j["tileAvailability"] = {{"bitstream", 7}}; }), HasSubstr("does not exist"));
  EXPECT_THAT(message([](Json& j) { j["tileAvailability"] = {{"constant", 0}}; }), HasSubstr("its root tile"));
  EXPECT_THAT(message([](Json& j) { j["bufferViews"][1]["byteLength"] = 1; }), HasSubstr("expected 2"));
  EXPECT_THAT(message([](Json& j) { j["bufferViews"][1]["byteOffset"] = 15; }), HasSubstr("outside its buffer"));
  EXPECT_THAT(message([](Json& j) { j["buffers"][0]["byteLength"] = 99; }), HasSubstr("binary part"));
  EXPECT_THAT(message([](Json& j) { j["contentAvailability"].push_back({{"constant", 1}}); }), HasSubstr("2 contents"));
  const std::string whole = transport::test_support::subtree(two_levels(), two_levels_binary());
  for (std::size_t length = 0; length < whole.size(); length += 5) {
    EXPECT_NE(base::test_support::error_of([&] { parse(whole.substr(0, length), box_tiling(false)); }), "") << length;
  }
  ImplicitTiling deep = box_tiling(true, 8, 32);
  EXPECT_THAT(base::test_support::error_of([&] {
                parse(R"({"tileAvailability":{"constant":1},"childSubtreeAvailability":{"constant":1}})", deep);
              }),
              HasSubstr("more than 1048576 tiles"));
}

Json implicit_tileset() {
  Json root = transport::test_support::tile(transport::test_support::box_volume(0, 0, 0, 8, 8, 4), 16, "a/{level}.{x}.{y}.glb");
  root["refine"] = "REPLACE";
  root["implicitTiling"] = {{"subdivisionScheme", "QUADTREE"},
                            {"subtreeLevels", 2},
                            {"availableLevels", 4},
                            {"subtrees", {{"uri", "s/{level}.{x}.{y}.subtree"}}}};
  return transport::test_support::tileset(root);
}

/// Two levels of subtrees, with a triangle for each of their tiles.
class ImplicitSource : public MemorySource {
 public:
  explicit ImplicitSource(const Json& tileset = implicit_tileset()) : transport::test_support::MemorySource(tileset) {
    add("s/0.0.0.subtree", transport::test_support::subtree(two_levels(), two_levels_binary()));
    const Json leaf = {{"tileAvailability", {{"constant", 1}}},
                       {"contentAvailability", {{{"constant", 1}}}},
                       {"childSubtreeAvailability", {{"constant", 0}}}};
    add("s/2.3.1.subtree", leaf.dump());
    add("s/2.1.2.subtree", transport::test_support::subtree(leaf));
    for (const char* tile : {"0.0.0", "1.1.0", "1.0.1", "2.3.1", "2.1.2", "3.6.2", "3.7.2", "3.6.3", "3.7.3", "3.2.4",
                             "3.3.4", "3.2.5", "3.3.5"}) {
      add("a/" + std::string(tile) + ".glb", transport::test_support::triangle_glb());
    }
  }
};

TEST(ImplicitTiling, TheFinestCutIsReadFromTwoLevelsOfSubtrees) {
  ImplicitSource source;
  const LoadedTiles tiles = load_region(source, "t", {});
  EXPECT_TRUE(tiles.complete);
  EXPECT_EQ(tiles.tiles_loaded, 8);
  EXPECT_DOUBLE_EQ(tiles.geometric_error_max_m, 2.0);
  EXPECT_EQ(source.reads().count("a/0.0.0.glb"), 0U);
  LoadOptions coarse;
  coarse.error_m = 8;
  ImplicitSource again;
  EXPECT_EQ(load_region(again, "t", coarse).tiles_loaded, 2);
  EXPECT_EQ(again.reads().count("s/2.3.1.subtree"), 0U);  // not needed, not read
}

TEST(ImplicitTiling, OnlyTheSubtreesOfTheRegionAreRead) {
  ImplicitSource source;
  LoadOptions options;
  options.center_local = Vec3(7, -3, 0);
  options.size = Vec3(1, 1, 1);
  const LoadedTiles tiles = load_region(source, "t", options);
  EXPECT_EQ(source.reads().count("s/2.1.2.subtree"), 0U);
  EXPECT_EQ(tiles.tiles_loaded, 1);
  EXPECT_EQ(source.reads().count("a/3.7.2.glb"), 1U);
}

TEST(ImplicitTiling, TheExtensionOf10ReadsAlike) {
  Json tileset = implicit_tileset();
  tileset["asset"]["version"] = "1.0";
  tileset["extensionsRequired"] = {"3DTILES_implicit_tiling"};
  Json implicit = tileset["root"]["implicitTiling"];
  tileset["root"].erase("implicitTiling");
  implicit.erase("availableLevels");
  implicit["maximumLevel"] = 3;
  tileset["root"]["extensions"]["3DTILES_implicit_tiling"] = implicit;
  ImplicitSource source(tileset);
  EXPECT_EQ(load_region(source, "t", {}).tiles_loaded, 8);
}

TEST(ImplicitTiling, AMissingSubtreeIsNamedAndCounted) {
  ImplicitSource source;
  source.remove("s/2.1.2.subtree");
  EXPECT_THAT(base::test_support::error_of([&] { load_region(source, "t", {}); }),
              HasSubstr("tile root: level 2, x 1, y 2: s/2.1.2.subtree: is missing"));
  const TilesetSummary summary = inspect_tileset(source);
  EXPECT_EQ(summary.failures.size(), 1U);
  LoadOptions options;
  options.allow_incomplete = true;
  const LoadedTiles tiles = load_region(source, "t", options);
  EXPECT_FALSE(tiles.complete);
  EXPECT_EQ(tiles.tiles_loaded, 4);
}

TEST(ImplicitTiling, InspectCountsItsTiles) {
  ImplicitSource source;
  const TilesetSummary summary = inspect_tileset(source);
  EXPECT_EQ(summary.tiles, 13);
  EXPECT_EQ(summary.depth(), 4);
  EXPECT_EQ(summary.subtrees, 3);
  EXPECT_EQ(summary.leaves, 8);
  EXPECT_EQ(summary.contents.at("glb"), 13);
  EXPECT_EQ(summary.content_files_missing, 0);
}

TEST(ImplicitTiling, WhatCannotBeDividedIsRefused) {
  const auto message = [](const std::function<void(Json&)>& change) {
    Json tileset = implicit_tileset();
    change(tileset["root"]);
    ImplicitSource source(tileset);
    return base::test_support::error_of([&] { load_region(source, "t", {}); });
  };
  EXPECT_THAT(message([](Json& r) { r["boundingVolume"] = {{"sphere", {0, 0, 0, 1}}}; }), HasSubstr("is a sphere"));
  EXPECT_THAT(message([](Json& r) {
                r["children"] =
                    Json::array({transport::test_support::tile(transport::test_support::box_volume(0, 0, 0, 1, 1, 1), 1)});
              }),
              HasSubstr("both implicitTiling and children"));
  EXPECT_THAT(message([](Json& r) { r["implicitTiling"]["subdivisionScheme"] = "KD"; }), HasSubstr("'KD'"));
  EXPECT_THAT(message([](Json& r) { r["implicitTiling"]["subtreeLevels"] = 0; }), HasSubstr("subtreeLevels is 0"));
  EXPECT_THAT(message([](Json& r) { r["implicitTiling"]["availableLevels"] = 99; }), HasSubstr("availableLevels"));
  EXPECT_THAT(message([](Json& r) { r["content"]["uri"] = "{w}.glb"; }), HasSubstr("{w}"));
}

TEST(ImplicitTiling, ExplicitTilesTakeVolumesFromTheirMetadata) {
  Json tileset = transport::test_support::tileset(
      transport::test_support::tile(transport::test_support::box_volume(0, 0, 0, 8, 8, 8), 4, "a.glb"));
  tileset["schema"] = {
      {"classes",
       {{"t",
         {{"properties",
           {{"v",
             {{"type", "SCALAR"},
              {"componentType", "FLOAT64"},
              {"array", true},
              {"count", 4},
              {"semantic", "TILE_BOUNDING_SPHERE"}}},
            {"e", {{"type", "SCALAR"}, {"componentType", "FLOAT64"}, {"semantic", "TILE_GEOMETRIC_ERROR"}}}}}}}}}};
  tileset["root"]["metadata"] = {{"class", "t"}, {"properties", {{"v", {1, 2, 3, 4}}, {"e", 0.5}}}};
  const Tileset read = parse_tileset_json(tileset.dump(), "t");
  const auto sphere = std::get<BoundingSphere>(read.tiles[0].bounding_volume);
  EXPECT_EQ(sphere.center, Vec3(1, 2, 3));
  EXPECT_EQ(sphere.radius_m, 4);
  EXPECT_EQ(read.tiles[0].geometric_error_m, 0.5);
  // The same with the schema in a separate file, and with a warning and no volume if it cannot be read.
  Json outside = tileset;
  outside.erase("schema");
  outside["schemaUri"] = "schema.json";
  const std::string schema = tileset["schema"].dump();
  const Tileset same = parse_tileset_json(outside.dump(), "t", {}, [&](const std::string& uri) {
    EXPECT_EQ(uri, "schema.json");
    return schema;
  });
  EXPECT_EQ(same.tiles[0].geometric_error_m, 0.5);
  const Tileset without = parse_tileset_json(
      outside.dump(), "t", {}, [](const std::string& uri) -> std::string { throw InputError(uri, "is missing"); });
  EXPECT_EQ(without.tiles[0].geometric_error_m, 4);
  EXPECT_THAT(without.warnings, ElementsAre(HasSubstr("schema.json: is missing")));
}

TEST(Selection, AViewerOutsideOfTheRequestVolumeSeesNothing) {
  Json root = transport::test_support::tile(transport::test_support::box_volume(0, 0, 0, 8, 8, 8), 4, "a.glb");
  root["viewerRequestVolume"] = {{"sphere", {0, 0, 0, 20}}};
  MemorySource source(transport::test_support::tileset(root));
  TilesetTree tree(source);
  RefinementCriterion wanted = region_criterion({Vec3::Zero(), Vec3::Constant(100)}, geometry::SE3(), 0);
  EXPECT_EQ(select_cut(tree, wanted).contents.size(), 1U);  // no viewer: it is part of the site
  const auto viewer_at = [&](double x) {
    wanted.contains_viewer = [x](const BoundingVolume& volume) {
      return intersects(volume, geometry::SE3(), geometry::Box3(Vec3(x, 0, 0), Vec3(x, 0, 0)));
    };
    return select_cut(tree, wanted).contents.size();
  };
  EXPECT_EQ(viewer_at(10), 1U);
  EXPECT_EQ(viewer_at(30), 0U);
}

/// A full tree of millions of tiles: every subtree file is the same.
class FullTree : public MemorySource {
 public:
  FullTree(bool octree, int levels, int subtree_levels) : MemorySource(tileset_of(octree, levels, subtree_levels)) {}

  Bytes read(const std::string& uri) override {
    if (!uri.ends_with(".subtree")) return MemorySource::read(uri);
    ++subtrees_read;
    return base::test_support::to_bytes(
        R"({"tileAvailability":{"constant":1},"contentAvailability":[{"constant":1}],"childSubtreeAvailability":{"constant":1}})");
  }

  std::size_t subtrees_read = 0;

 private:
  static Json tileset_of(bool octree, int levels, int subtree_levels) {
    const std::string place = octree ? "{level}.{x}.{y}.{z}" : "{level}.{x}.{y}";
    Json root = transport::test_support::tile(transport::test_support::box_volume(0, 0, 0, 2048, 2048, 2048), 2048,
                                              "a/" + place + ".glb");
    root["refine"] = "REPLACE";
    root["implicitTiling"] = {{"subdivisionScheme", octree ? "OCTREE" : "QUADTREE"},
                              {"subtreeLevels", subtree_levels},
                              {"availableLevels", levels},
                              {"subtrees", {{"uri", "s/" + place + ".subtree"}}}};
    return transport::test_support::tileset(root);
  }
};

/// Of 5.6 million tiles (quadtree) and 2.4 million (octree), those of a few metres. Leaves are 2 m and 32 m wide.
TEST(Selection, OfARegionVisitsOnlyItsPartOfATreeOfMillions) {
  FullTree quadtree(false, 12, 4);
  TilesetTree tree(quadtree);
  const Region region{Vec3(100.5, -99.5, 0), Vec3(10, 10, 10)};
  const TileCut cut = select_cut(tree, region_criterion(region, geometry::SE3(), 0.0));
  EXPECT_EQ(cut.contents.size(), 36U) << "from 94 to 106, and from -106 to -94, in steps of 2 m";
  EXPECT_THAT(cut.failures, ::testing::IsEmpty());
  EXPECT_EQ(quadtree.subtrees_read, 1U + 1U + 4U);
  EXPECT_LT(tree.node_count(), 250U);

  FullTree octree(true, 8, 4);
  TilesetTree cubes(octree);
  EXPECT_EQ(select_cut(cubes, region_criterion(region, geometry::SE3(), 0.0)).contents.size(), 2U * 2U * 2U);
  EXPECT_EQ(octree.subtrees_read, 1U + 2U);
  EXPECT_LT(cubes.node_count(), 250U);
}

/// Ten levels in a single file: 350 000 tiles in a few hundred bytes.
TEST(Selection, ASubtreeFileIsNotExpandedWhole) {
  FullTree source(false, 10, 10);
  TilesetTree tree(source);
  const Region region{Vec3(101, -101, 0), Vec3(2, 2, 2)};
  EXPECT_EQ(select_cut(tree, region_criterion(region, geometry::SE3(), 0.0)).contents.size(), 1U);
  EXPECT_EQ(source.subtrees_read, 1U);
  EXPECT_LT(tree.node_count(), 60U);
}

TEST(Selection, OfMoreThanTheLimitsIsRefusedInOneLine) {
  const RefinementCriterion all = region_criterion({Vec3::Zero(), Vec3::Constant(5000)}, geometry::SE3(), 0.0);
  FullTree source(true, 32, 1);
  TilesetTree few_tiles(source, {.max_nodes = 1000});
  EXPECT_THAT(base::test_support::error_of([&] { select_cut(few_tiles, all); }),
              HasSubstr("has more than 1000 tiles in what was asked for; ask for a smaller region"));
  EXPECT_LE(few_tiles.node_count(), 1000U);
  TilesetTree few_files(source, {.max_files = 50});
  EXPECT_THAT(base::test_support::error_of([&] { select_cut(few_files, all); }),
              HasSubstr("more than 50 external tilesets and subtrees"));
}

LoadedTiles load(const std::filesystem::path& file) { return load_region(file.string(), {}); }

/// Every content lies inside its tile: the cells of a sparse cube, each about a quarter of its cell.
TEST(ImplicitTiling, RealSparseTrees) {
  TILEFLIGHT_REQUIRE_TEST_DATA(folder, "tilesets/cesium_3d_tiles_samples/1.1");
  const LoadedTiles quadtree = load(folder / "SparseImplicitQuadtree" / "tileset.json");
  EXPECT_EQ(quadtree.tiles_loaded, 32);
  const LoadedTiles octree = load(folder / "SparseImplicitOctree" / "tileset.json");
  EXPECT_GT(octree.tiles_loaded, 0);
  EXPECT_EQ(octree.tiles_loaded, octree.tiles_wanted);
  for (const LoadedTiles* tiles : {&quadtree, &octree}) {
    ASSERT_FALSE(tiles->meshes.empty());
    geometry::Box3 box;
    for (const imaging::TexturedMesh& mesh : tiles->meshes) box.extend(geometry::bounds(mesh.mesh));
    EXPECT_LT((box.min() - tiles->region.box().min()).norm(), 0.1);
    EXPECT_LT((box.max() - tiles->region.box().max()).norm(), 0.1);
  }
}

}  // namespace
}  // namespace tileflight::tiles::implicit_tiling_test
