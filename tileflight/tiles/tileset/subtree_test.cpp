#include "tileflight/tiles/tileset/subtree.h"

#include <gmock/gmock.h>

#include <functional>
#include <nlohmann/json.hpp>
#include <random>

#include "tileflight/tiles/fetch/test_tilesets.h"
#include "tileflight/tiles/tileset/test_subtrees.h"

namespace tileflight::tileset::subtree_test {
namespace {

using base::test_support::error_of;
using base::test_support::to_bytes;
using fetch::test_support::Json;
using geometry::Vec3;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using namespace test_support;

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

/// 3D Tiles 1.1, "Implicit Tiling": a child's bit of each axis follows its parent's.
TileCoordinates child_coordinates(const TileCoordinates& parent, std::uint32_t child) {
  TileCoordinates out{parent.level + 1, {}};
  for (std::size_t i = 0; i < 3; ++i) out.xyz[i] = 2 * parent.xyz[i] + (child >> i & 1U);
  return out;
}

TEST(Subtree, BitsAreInMortonOrder) {
  expect_two_levels(parse(fetch::test_support::subtree(two_levels(), two_levels_binary()), box_tiling(false)));
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
  expect_two_levels(parse(fetch::test_support::subtree(json, two_levels_binary()), box_tiling(false)));
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
  const std::vector<ExpandedTile> read = expand(parse(fetch::test_support::subtree(json, two_levels_binary()), tiling));
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
      std::make_shared<const tile_content::MetadataSchema>(tile_content::parse_metadata_schema(schema, "schema"));
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
  const std::vector<ExpandedTile> read = expand(parse(fetch::test_support::subtree(json, binary), tiling));
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
    const Subtree read = parse(fetch::test_support::subtree(json, binary), tiling, root);

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
  tiling.schema = std::make_shared<const tile_content::MetadataSchema>(tile_content::parse_metadata_schema(
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
  const Subtree read = parse(fetch::test_support::subtree(json, binary), tiling);
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
        [&] { parse(fetch::test_support::subtree(json, two_levels_binary()), box_tiling(false)); });
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
  const std::string whole = fetch::test_support::subtree(two_levels(), two_levels_binary());
  for (std::size_t length = 0; length < whole.size(); length += 5) {
    EXPECT_NE(base::test_support::error_of([&] { parse(whole.substr(0, length), box_tiling(false)); }), "") << length;
  }
  ImplicitTiling deep = box_tiling(true, 8, 32);
  EXPECT_THAT(base::test_support::error_of([&] {
                parse(R"({"tileAvailability":{"constant":1},"childSubtreeAvailability":{"constant":1}})", deep);
              }),
              HasSubstr("more than 1048576 tiles"));
}

}  // namespace
}  // namespace tileflight::tileset::subtree_test
