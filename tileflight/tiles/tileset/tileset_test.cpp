#include "tileflight/tiles/tileset/tileset.h"

#include <gmock/gmock.h>

#include <nlohmann/json.hpp>

#include "tileflight/tiles/fetch/test_tilesets.h"

namespace tileflight::tileset::tileset_test {
namespace {

using base::test_support::error_of;
using fetch::test_support::box_volume;
using fetch::test_support::Json;
using fetch::test_support::tile;
using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

Tileset parse(const Json& json) { return parse_tileset_json(json.dump(), "t.json"); }

const Json kBox = fetch::test_support::box_volume(1, 2, 3, 4, 5, 6);

TEST(ParseTileset, ReadsAllParts) {
  Json root = fetch::test_support::tile(kBox, 20, "a.glb");
  root["refine"] = "ADD";
  root["transform"] = {2, 0, 0, 0, 0, 3, 0, 0, 0, 0, 4, 0, 10, 20, 30, 1};
  root["children"] = {fetch::test_support::tile({{"sphere", {1, 2, 3, 4}}}, 10, "b.glb"),
                      fetch::test_support::tile({{"region", {0.1, 0.2, 0.3, 0.4, -5, 6}}}, 0)};
  root["children"][0]["children"] = Json::array({fetch::test_support::tile(kBox, 1)});
  root["children"][1]["refine"] = "REPLACE";
  root["children"][1]["contents"] = {{{"uri", "c.glb"}, {"boundingVolume", kBox}}, {{"uri", "d.glb"}}};
  Json json = fetch::test_support::tileset(root, "1.0");
  json["asset"]["copyright"] = "A; B";
  json["asset"]["gltfUpAxis"] = "Z";
  json["extensionsUsed"] = {"X"};
  const Tileset t = parse(json);

  EXPECT_EQ(t.version, "1.0");
  EXPECT_EQ(t.copyright, "A; B");
  EXPECT_EQ(t.gltf_up_axis, tile_content::UpAxis::kZ);
  EXPECT_THAT(t.extensions_used, ElementsAre("X"));
  EXPECT_THAT(t.warnings, IsEmpty());
  ASSERT_EQ(t.tiles.size(), 4U);
  EXPECT_THAT(t.tiles[0].children, ElementsAre(1U, 3U));
  EXPECT_EQ(t.tiles[2].path, "root/0/0");
  EXPECT_EQ(t.tiles[2].level, 2);
  EXPECT_EQ(t.tiles[2].refine, Refine::kAdd);  // inherited
  EXPECT_EQ(t.tiles[3].refine, Refine::kReplace);
  const geometry::Vec3 moved = (t.tiles[0].T_parent_tile * Eigen::Vector4d(1, 1, 1, 1)).head<3>();
  EXPECT_EQ(moved, geometry::Vec3(12, 23, 34));
  EXPECT_EQ(std::get<OrientedBox>(t.tiles[0].bounding_volume).half_axes.diagonal(), geometry::Vec3(4, 5, 6));
  EXPECT_EQ(std::get<BoundingSphere>(t.tiles[1].bounding_volume).radius_m, 4);
  EXPECT_EQ(std::get<GeographicRegion>(t.tiles[3].bounding_volume).north_rad, 0.4);
  ASSERT_EQ(t.tiles[3].contents.size(), 2U);
  EXPECT_TRUE(t.tiles[3].contents[0].bounding_volume.has_value());
  EXPECT_EQ(t.tiles[3].contents[1].uri, "d.glb");
}

TEST(ParseTileset, BoxColumnsAreTheHalfAxes) {
  const Tileset t = parse(
      fetch::test_support::tileset(fetch::test_support::tile({{"box", {0, 0, 0, 1, 2, 3, -4, -5, -6, 7, 8, 9}}}, 0)));
  EXPECT_EQ(std::get<OrientedBox>(t.tiles[0].bounding_volume).half_axes.col(1), geometry::Vec3(-4, -5, -6));
}

TEST(ParseTileset, ReadsWhatRealFilesMean) {
  Json root = fetch::test_support::tile(kBox, 9007199254740991.0);
  root["content"] = nullptr;
  root["transform"] = nullptr;
  root["refine"] = "add";
  Json child = {{"boundingVolume", kBox}, {"content", {{"url", "a.b3dm"}}}};
  child["extensions"] = {{"3DTILES_multiple_contents", {{"content", {{{"uri", "b.glb"}}}}}}};
  root["children"] = Json::array({child});
  Json json = fetch::test_support::tileset(root);
  json.erase("geometricError");
  const Tileset t = parse(json);
  EXPECT_THAT(t.tiles[0].contents, IsEmpty());
  EXPECT_EQ(t.tiles[0].geometric_error_m, 9007199254740991.0);
  EXPECT_EQ(t.tiles[0].refine, Refine::kAdd);
  EXPECT_EQ(t.tiles[1].geometric_error_m, 9007199254740991.0);
  ASSERT_EQ(t.tiles[1].contents.size(), 2U);
  EXPECT_EQ(t.tiles[1].contents[0].uri, "a.b3dm");
  EXPECT_EQ(t.warnings.size(), 3U);
  EXPECT_EQ(parse_tileset_json("\xEF\xBB\xBF" + json.dump(), "t").tiles.size(), 2U);
}

/// DJI Terra and FME state 0.0 for what is 1.0; others write a number.
TEST(ParseTileset, ReadsTheVersionsThatWritersState) {
  struct Case {
    Json written;
    const char* read;
    bool warns;
  };
  const Case cases[] = {{"1.0", "1.0", false},  {"1.1", "1.1", false}, {"0.0", "1.0", true},  {"0", "1.0", true},
                        {"0.0.1", "1.0", true}, {"1", "1.0", true},    {1.0, "1.0", false},   {1, "1.0", true},
                        {1.1, "1.1", false},    {0, "1.0", true},      {"1.1.0", "1.1", true}};
  for (const auto& [written, read, warns] : cases) {
    Json json = fetch::test_support::tileset(fetch::test_support::tile(kBox, 1));
    json["asset"]["version"] = written;
    const Tileset t = parse(json);
    EXPECT_EQ(t.version, read) << written;
    EXPECT_EQ(t.warnings.size(), warns ? 1U : 0U) << written;
  }
}

/// CesiumJS reads such tiles as empty, too.
TEST(ParseTileset, ReadsContentsWithoutUriAsNone) {
  for (const Json& content : {Json::object(), Json{{"uri", ""}}, Json{{"url", ""}}, Json{{"uri", nullptr}}}) {
    Json root = fetch::test_support::tile(kBox, 1);
    root["content"] = content;
    Json child = fetch::test_support::tile(kBox, 0, "a.glb");
    child["contents"] = Json::array({content, {{"uri", "b.glb"}}});
    child.erase("content");
    root["children"] = Json::array({child});
    const Tileset t = parse(fetch::test_support::tileset(root));
    EXPECT_THAT(t.tiles[0].contents, IsEmpty()) << content;
    ASSERT_EQ(t.tiles[1].contents.size(), 1U) << content;
    EXPECT_EQ(t.tiles[1].contents[0].uri, "b.glb");
    EXPECT_THAT(t.warnings, ElementsAre(HasSubstr("no uri")));
  }
}

TEST(ParseTileset, NamesWhatItLacks) {
  const Json root = fetch::test_support::tile({{"extensions", {{"ACME_cone", {{"half_angle", 1}}}}}}, 1);
  EXPECT_EQ(parse(fetch::test_support::tileset(root)).tiles[0].unsupported, "the bounding volume ACME_cone");
  Json json = fetch::test_support::tileset(fetch::test_support::tile(kBox, 1));
  json["extensionsRequired"] = {"3DTILES_content_gltf", "ACME_secret", "ACME_secret"};
  EXPECT_THAT(unsupported_extensions(parse(json)), ElementsAre("ACME_secret"));
}

/// Each fault and a word of the expected message; `path` is a JSON pointer.
TEST(ParseTileset, NamesEachFault) {
  struct Fault {
    const char* path;
    Json value;
    const char* message;
  };
  const Fault faults[] = {
      {"/asset", nullptr, "asset is missing"},
      {"/asset/version", nullptr, "version is missing"},
      {"/asset/version", true, "version is boolean, expected a string"},
      {"/asset/version", "2.0", "version '2.0' is not supported"},
      {"/asset/version", 1.5, "version '1.5' is not supported"},
      {"/asset/gltfUpAxis", "W", "gltfUpAxis"},
      {"/root", nullptr, "root is missing"},
      {"/root", Json::array(), "root is array, expected an object"},
      {"/geometricError", -1, "geometricError is negative"},
      {"/geometricError", "1", "geometricError is string, expected a number"},
      {"/root/geometricError", -1, "tile root: geometricError is negative"},
      {"/root/boundingVolume", nullptr, "no box, region or sphere"},
      {"/root/boundingVolume", 3, "boundingVolume is number"},
      {"/root/boundingVolume/box", {1, 2, 3}, "box has 3 numbers, expected 12"},
      {"/root/boundingVolume/box/3", "1", "box is string"},
      {"/root/boundingVolume", {{"sphere", {0, 0, 0, -1}}}, "radius"},
      {"/root/boundingVolume", {{"region", {0, 2, 0, 2, 0, 0}}}, "angle outside"},
      {"/root/boundingVolume", {{"region", {0, 1, 0, 0.5, 0, 0}}}, "south above its north"},
      {"/root/refine", "SOMETIMES", "refine is 'SOMETIMES'"},
      {"/root/refine", 1, "refine is number"},
      {"/root/transform", {1, 2, 3}, "transform has 3 numbers, expected 16"},
      {"/root/transform", {1, 0, 0, 1, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1}, "not affine"},
      {"/root/content", 1, "content is number"},
      {"/root/content", {{"uri", 1}}, "uri is number"},
      {"/root/contents", {1}, "is not an object"},
      {"/root/children", 1, "children is number"},
      {"/root/children", {1}, "tile root/0: is not an object"},
      {"/extensionsRequired", "x", "extensionsRequired is string"},
  };
  const Json good = fetch::test_support::tileset(fetch::test_support::tile(kBox, 1));
  EXPECT_EQ(base::test_support::error_of([&] { parse(good); }), "");
  for (const Fault& fault : faults) {
    Json bad = good;
    bad[Json::json_pointer(fault.path)] = fault.value;
    const std::string message = base::test_support::error_of([&] { parse(bad); });
    EXPECT_THAT(message, HasSubstr("t.json: ")) << fault.path;
    EXPECT_THAT(message, HasSubstr(fault.message)) << fault.path;
  }
}

TEST(ParseTileset, MalformedAndCutShort) {
  const std::string text = fetch::test_support::tileset(fetch::test_support::tile(kBox, 1, "a.glb")).dump();
  for (std::size_t length = 0; length < text.size(); ++length) {
    EXPECT_THAT(base::test_support::error_of([&] { parse_tileset_json(text.substr(0, length), "t.json"); }),
                AllOf(HasSubstr("not valid JSON at line 1, column "), HasSubstr("ends early")));
  }
  EXPECT_THAT(base::test_support::error_of([] { parse_tileset_json("<html></html>", "t.json"); }),
              HasSubstr("not valid JSON"));
  EXPECT_THAT(base::test_support::error_of([] { parse_tileset_json("[]", "t.json"); }), HasSubstr("is not a tileset"));
  EXPECT_THAT(base::test_support::error_of([] { parse_tileset_json("{\"geometricError\":1e999}", "t.json"); }),
              HasSubstr("t.json"));
}

/// Each fault of a text, and where and what the message says.
TEST(ParseTileset, MessagesNameLineColumnAndCause) {
  const std::pair<std::string, const char*> cases[] = {{"{\n \"a\": [1, 2\n \"b\": 3}", "line 3, column "},
                                                       {"{\n \"a\": [1, 2}", "line 2, column 12: unexpected '}'"},
                                                       {"{\"a\": NaN}", "line 1, column "},
                                                       {"{\"a\": NaN}", "NaN is not a number in JSON"},
                                                       {"{\"a\":\n -Infinity}", "-Infinity is not a number in JSON"},
                                                       {std::string("\xFF\xFE{\0\"\0a\0", 8), "UTF-16"},
                                                       {std::string("{\0\"\0a\0", 6), "UTF-16"},
                                                       {"{\"ä\": 1, }", "line 1, column 10: unexpected '}'"},
                                                       {"", "line 1, column 1: the text ends early"},
                                                       {"{\"a\": \"b\nc\"}", "line 1, column "}};
  for (const auto& [text, wanted] : cases) {
    EXPECT_THAT(base::test_support::error_of([&, &text = text] { parse_tileset_json(text, "t.json"); }),
                AllOf(HasSubstr("t.json: not valid JSON at line "), HasSubstr(wanted)))
        << text;
  }
}

TEST(ParseTileset, Limits) {
  Json deep = fetch::test_support::tile(kBox, 0);
  for (int i = 0; i < 30; ++i) {
    Json parent = fetch::test_support::tile(kBox, i);
    parent["children"] = Json::array({deep});
    deep = parent;
  }
  const std::string text = fetch::test_support::tileset(deep).dump();
  EXPECT_EQ(parse_tileset_json(text, "t").tiles.size(), 31U);
  EXPECT_THAT(base::test_support::error_of([&] { parse_tileset_json(text, "t", {.max_levels = 20}); }),
              HasSubstr("more than 20 levels"));
  EXPECT_THAT(base::test_support::error_of([&] { parse_tileset_json(text, "t", {.max_tiles = 20}); }),
              HasSubstr("more than 20 tiles"));
  EXPECT_THAT(base::test_support::error_of([&] { parse_tileset_json(text, "t", {.max_bytes = 20}); }),
              HasSubstr("at most 20"));
  const std::string nested(1000000, '[');
  EXPECT_THAT(base::test_support::error_of([&] { parse_tileset_json(nested, "t"); }), HasSubstr("nested 1000000 deep"));
}

}  // namespace
}  // namespace tileflight::tileset::tileset_test
