#include <gmock/gmock.h>

#include <nlohmann/json.hpp>
#include <set>
#include <span>

#include "tests/test_data.h"
#include "tileflight/core/imaging/image_files.h"
#include "tileflight/tiles/fetch/test_tilesets.h"
#include "tileflight/tiles/tile_content/pnts.h"
#include "tileflight/tiles/tile_content/property_table.h"
#include "tileflight/tiles/tileset/load.h"

/// Assignment of triangles to buildings: batch tables, EXT_mesh_features, EXT_instance_features.
namespace tileflight::tileset::features_test {
namespace {

using base::test_support::error_of;
using base::test_support::to_raw_bytes;
using fetch::test_support::GltfWriter;
using fetch::test_support::Json;
using imaging::kNoFeature;
using imaging::TexturedMesh;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

tile_content::MetadataSchema schema(const Json& properties, const Json& enums = Json::object()) {
  return tile_content::parse_metadata_schema({{"classes", {{"c", {{"properties", properties}}}}}, {"enums", enums}},
                                             "schema");
}

/// A table over these columns, each a bufferView.
tile_content::PropertyTable table(const Json& properties, std::size_t count, const Json& columns,
                                  const std::vector<std::string>& views, const Json& enums = Json::object()) {
  const auto view = [&](std::size_t i) { return std::as_bytes(std::span(views.at(i))); };
  return tile_content::PropertyTable({{"class", "c"}, {"count", count}, {"properties", columns}},
                                     schema(properties, enums), view, "t");
}

TEST(PropertyTable, NumbersOfAnyType) {
  const std::vector<std::string> views = {base::test_support::to_raw_bytes<std::int16_t>({-3, 32767}),
                                          base::test_support::to_raw_bytes<std::uint64_t>({1, 18446744073709551615U}),
                                          base::test_support::to_raw_bytes<float>({1, 2, 3, 4, 5, 6}),
                                          base::test_support::to_raw_bytes<std::uint8_t>({0, 255})};
  const tile_content::PropertyTable t = table(
      {{"a", {{"type", "SCALAR"}, {"componentType", "INT16"}}},
       {"b", {{"type", "SCALAR"}, {"componentType", "UINT64"}}},
       {"c", {{"type", "VEC3"}, {"componentType", "FLOAT32"}}},
       {"d", {{"type", "SCALAR"}, {"componentType", "UINT8"}, {"normalized", true}, {"scale", 10}, {"offset", -5}}}},
      2, {{"a", {{"values", 0}}}, {"b", {{"values", 1}}}, {"c", {{"values", 2}}}, {"d", {{"values", 3}}}}, views);
  EXPECT_THAT(*t.numbers(0, 0), ElementsAre(-3));
  EXPECT_EQ(t.text(1, 1), "18446744073709551615");
  EXPECT_THAT(*t.numbers(2, 1), ElementsAre(4, 5, 6));
  EXPECT_EQ(t.text(2, 0), "1 2 3");
  EXPECT_THAT(*t.numbers(3, 1), ElementsAre(5));
  EXPECT_EQ(t.text(3, 0), "-5");
  EXPECT_FALSE(t.numbers(0, 2).has_value());
}

TEST(PropertyTable, StringsBooleansEnumsAndArrays) {
  const std::vector<std::string> views = {"hallbarn",
                                          base::test_support::to_raw_bytes<std::uint8_t>({0, 4, 8}),
                                          std::string("\x02"),
                                          base::test_support::to_raw_bytes<std::uint8_t>({1, 9}),
                                          base::test_support::to_raw_bytes<std::uint16_t>({5, 6, 7}),
                                          base::test_support::to_raw_bytes<std::uint32_t>({0, 1, 3})};
  const tile_content::PropertyTable t =
      table({{"a", {{"type", "STRING"}}},
             {"b", {{"type", "BOOLEAN"}}},
             {"c", {{"type", "ENUM"}, {"enumType", "kind"}}},
             {"d", {{"type", "SCALAR"}, {"componentType", "UINT16"}, {"array", true}}}},
            2,
            {{"a", {{"values", 0}, {"stringOffsets", 1}, {"stringOffsetType", "UINT8"}}},
             {"b", {{"values", 2}}},
             {"c", {{"values", 3}}},
             {"d", {{"values", 4}, {"arrayOffsets", 5}}}},
            views, {{"kind", {{"valueType", "UINT8"}, {"values", {{{"name", "Tower"}, {"value", 1}}}}}}});
  EXPECT_EQ(t.text(0, 0), "hall");
  EXPECT_EQ(t.text(0, 1), "barn");
  EXPECT_EQ(t.text(1, 0), "false");
  EXPECT_EQ(t.text(1, 1), "true");
  EXPECT_EQ(t.text(2, 0), "Tower");
  EXPECT_EQ(t.text(2, 1), "9");
  EXPECT_EQ(t.text(3, 0), "5");
  EXPECT_EQ(t.text(3, 1), "6 7");
}

TEST(PropertyTable, FaultsAreNamed) {
  const Json number = {{"a", {{"type", "SCALAR"}, {"componentType", "UINT32"}}}};
  const Json text = {{"a", {{"type", "STRING"}}}};
  const auto message = [](const Json& properties, const Json& column, const std::vector<std::string>& views) {
    return base::test_support::error_of([&] { table(properties, 2, {{"a", column}}, views); });
  };
  EXPECT_THAT(message(number, {{"values", 0}}, {"1234567"}), HasSubstr("property a: needs 2 elements"));
  EXPECT_THAT(message(number, Json::object(), {}), HasSubstr("values is missing"));
  EXPECT_THAT(message(text, {{"values", 0}}, {"ab"}), HasSubstr("stringOffsets is missing"));
  EXPECT_THAT(message(text, {{"values", 0}, {"stringOffsets", 1}},
                      {"ab", base::test_support::to_raw_bytes<std::uint32_t>({0, 2, 1})}),
              HasSubstr("offsets decrease"));
  EXPECT_THAT(message(text, {{"values", 0}, {"stringOffsets", 1}},
                      {"ab", base::test_support::to_raw_bytes<std::uint32_t>({0, 1, 9})}),
              HasSubstr("needs 9 elements"));
  EXPECT_THAT(base::test_support::error_of([&] {
                table(number, 1, {{"b", {{"values", 0}}}}, {"1234"});
              }),
              HasSubstr("does not belong to class"));
  EXPECT_THAT(base::test_support::error_of([] {
                schema({{"a", {{"type", "VEC9"}, {"componentType", "UINT8"}}}});
              }),
              HasSubstr("'VEC9'"));
}

/// Two triangles; the first belongs to feature 1, the second to feature 0.
GltfWriter two_buildings(const std::string& attribute) {
  GltfWriter writer;
  const std::size_t positions =
      writer.add_accessor(std::vector<float>{0, 0, 0, 1, 0, 0, 0, 1, 0, 5, 0, 0, 6, 0, 0, 5, 1, 0}, 3);
  const std::size_t ids = writer.add_accessor(std::vector<float>{1, 1, 1, 0, 0, 0}, 1);
  writer.add_primitive({{"attributes", {{"POSITION", positions}, {attribute, ids}}}});
  return writer;
}

tile_content::DecodedContent decode(const std::string& bytes) {
  return tile_content::decode_content(base::test_support::to_bytes(bytes), "f");
}

TEST(Features, BatchTableOfAB3dm) {
  const std::string bytes =
      fetch::test_support::container("b3dm",
                                     {{{"BATCH_LENGTH", 2}},
                                      "",
                                      {{"name", {"Kelvin Hall", "Mill"}},
                                       {"height", {{"byteOffset", 0}, {"componentType", "DOUBLE"}, {"type", "SCALAR"}}},
                                       {"tags", {{{"a", 1}}, nullptr}}},
                                      base::test_support::to_raw_bytes<double>({20.5, 7})},
                                     two_buildings("_BATCHID").glb());
  const TexturedMesh mesh = decode(bytes).meshes.at(0);
  EXPECT_THAT(mesh.feature_ids, ElementsAre(1, 1, 1, 0, 0, 0));
  ASSERT_NE(mesh.features, nullptr);
  EXPECT_EQ(mesh.features->count, 2U);
  EXPECT_EQ(mesh.features->name(0), "Kelvin Hall");
  EXPECT_EQ(mesh.features->name(1), "Mill");
  EXPECT_EQ(mesh.features->name(2), "2");
  EXPECT_THAT(mesh.features->properties.at("height"), ElementsAre("20.5", "7"));
  EXPECT_THAT(mesh.features->properties.at("tags"), ElementsAre("{\"a\":1}", ""));
}

TEST(Features, ABrokenBatchTableCostsTheNamesNotTheTile) {
  const std::string bytes = fetch::test_support::container(
      "b3dm", {{{"BATCH_LENGTH", 2}}, "", {{"height", {{"byteOffset", 8}, {"componentType", "DOUBLE"}}}}, "short"},
      two_buildings("_BATCHID").glb());
  const tile_content::DecodedContent content = decode(bytes);
  EXPECT_THAT(content.warnings, ElementsAre(HasSubstr("features have no names")));
  EXPECT_EQ(content.meshes.at(0).features, nullptr);
  EXPECT_THAT(content.meshes.at(0).feature_ids, ElementsAre(1, 1, 1, 0, 0, 0));
}

/// Adds a table of two names as EXT_structural_metadata.
void add_names(GltfWriter& writer) {
  const std::size_t names = writer.add_view(std::vector<char>{'B', 'a', 'r', 'n', 'S', 'i', 'l', 'o'});
  const std::size_t ends = writer.add_view(std::vector<std::uint32_t>{0, 4, 8});
  writer.json()["extensions"]["EXT_structural_metadata"] = {
      {"schema", {{"id", "s"}, {"classes", {{"building", {{"properties", {{"name", {{"type", "STRING"}}}}}}}}}}},
      {"propertyTables",
       {{{"class", "building"},
         {"count", 2},
         {"properties", {{"name", {{"values", names}, {"stringOffsets", ends}}}}}}}}};
}

TEST(Features, MeshFeaturesWithAPropertyTable) {
  GltfWriter writer = two_buildings("_FEATURE_ID_0");
  add_names(writer);
  writer.json()["meshes"][0]["primitives"][0]["extensions"]["EXT_mesh_features"]["featureIds"] = {
      {{"featureCount", 2}, {"texture", {{"index", 0}}}},
      {{"featureCount", 2}, {"attribute", 0}, {"propertyTable", 0}, {"nullFeatureId", 0}}};
  const tile_content::DecodedContent content = decode(writer.glb());
  const TexturedMesh& mesh = content.meshes.at(0);
  EXPECT_THAT(mesh.feature_ids, ElementsAre(1, 1, 1, kNoFeature, kNoFeature, kNoFeature));
  EXPECT_EQ(mesh.features->name(1), "Silo");
  EXPECT_THAT(content.warnings, IsEmpty());
}

TEST(Features, ImplicitIds) {
  GltfWriter writer = two_buildings("_FEATURE_ID_0");
  Json& primitive = writer.json()["meshes"][0]["primitives"][0];
  primitive["extensions"]["EXT_mesh_features"]["featureIds"] = {{{"featureCount", 6}}};
  EXPECT_THAT(decode(writer.glb()).meshes.at(0).feature_ids, ElementsAre(0, 1, 2, 3, 4, 5));
}

/// A square of two triangles that share an edge, over an image of two texels: 258 on the left, 1 on the right.
TEST(Features, IdsInATexture) {
  GltfWriter writer;
  const std::size_t positions = writer.add_accessor(std::vector<float>{0, 0, 0, 9, 0, 0, 0, 9, 0, 9, 9, 0}, 3);
  const std::size_t coords = writer.add_accessor(std::vector<float>{0.1F, 0, 0.6F, 0, 0.1F, 1, 0.9F, 1}, 2);
  const std::size_t corners = writer.add_accessor(std::vector<std::uint16_t>{0, 1, 2, 1, 3, 2}, 1);
  imaging::RgbImage image(2, 1);
  image.pixels = {{2, 9, 1}, {1, 9, 0}};
  const std::vector<std::byte> png = imaging::encode_png(image);
  const std::size_t picture = writer.add_view(png);
  writer.json()["images"] = {{{"bufferView", picture}, {"mimeType", "image/png"}}};
  writer.json()["textures"] = {{{"source", 0}}};
  writer.add_primitive({{"attributes", {{"POSITION", positions}, {"TEXCOORD_1", coords}}}, {"indices", corners}});
  Json& sets = writer.json()["meshes"][0]["primitives"][0]["extensions"]["EXT_mesh_features"]["featureIds"];
  sets = {{{"featureCount", 2}, {"texture", {{"index", 0}, {"texCoord", 1}, {"channels", {0, 2}}}}}};
  const tile_content::DecodedContent content = decode(writer.glb());
  const TexturedMesh& mesh = content.meshes.at(0);
  ASSERT_EQ(mesh.mesh.vertices.size(), 6U);  // the shared edge stands twice
  ASSERT_EQ(mesh.feature_ids.size(), 6U);
  for (std::size_t t = 0; t < 2; ++t) {
    for (const std::uint32_t corner : mesh.mesh.triangles[t]) EXPECT_EQ(mesh.feature_ids[corner], t == 0 ? 258U : 1U);
  }
  EXPECT_EQ(mesh.mesh.vertices[mesh.mesh.triangles[1][0]], mesh.mesh.vertices[1]);
  EXPECT_THAT(content.warnings, IsEmpty());
  sets[0]["nullFeatureId"] = 1;
  EXPECT_EQ(decode(writer.glb()).meshes[0].feature_ids[mesh.mesh.triangles[1][1]], kNoFeature);
  sets[0]["texture"]["channels"] = {3};
  EXPECT_THAT(decode(writer.glb()).warnings, ElementsAre("feature ids in a texture's fourth channel are ignored"));
  sets[0]["texture"]["channels"] = {4};
  EXPECT_THAT(base::test_support::error_of([&] { decode(writer.glb()); }),
              HasSubstr("a texture channel that does not exist"));
}

TEST(Features, InstancesHaveIdsOfTheirOwn) {
  GltfWriter writer = two_buildings("COLOR_9");
  add_names(writer);
  const std::size_t places = writer.add_accessor(std::vector<float>{0, 0, 0, 9, 0, 0}, 3);
  const std::size_t ids = writer.add_accessor(std::vector<std::uint16_t>{1, 0}, 1);
  writer.json()["nodes"][0]["extensions"] = {
      {"EXT_mesh_gpu_instancing", {{"attributes", {{"TRANSLATION", places}, {"_FEATURE_ID_0", ids}}}}},
      {"EXT_instance_features", {{"featureIds", {{{"featureCount", 2}, {"attribute", 0}, {"propertyTable", 0}}}}}}};
  const tile_content::DecodedContent content = decode(writer.glb());
  ASSERT_EQ(content.meshes.size(), 2U);
  EXPECT_EQ(content.meshes[0].features->name(content.meshes[0].feature_ids[0]), "Silo");
  EXPECT_EQ(content.meshes[1].features->name(content.meshes[1].feature_ids[5]), "Barn");
}

TEST(Features, PointsOfAGltf) {
  GltfWriter writer = two_buildings("_FEATURE_ID_0");
  writer.json()["meshes"][0]["primitives"][0]["mode"] = 0;
  const tile_content::DecodedContent content = decode(writer.glb());
  EXPECT_TRUE(content.meshes.empty());
  ASSERT_EQ(content.clouds.size(), 1U);
  EXPECT_EQ(content.clouds[0].positions[4], geometry::Vec3(6, 0, 0));
  EXPECT_EQ(content.clouds[0].positions[5], geometry::Vec3(5, 0, 1));  // turned z up
  EXPECT_THAT(content.clouds[0].scalars.at(tile_content::kFeatureIdScalar), ElementsAre(1, 1, 1, 0, 0, 0));
  EXPECT_EQ(content.clouds[0].colors[0], (std::array<std::uint8_t, 3>{255, 255, 255}));
}

/// Ten buildings with a table of names.
TEST(Features, RealBatchTables) {
  TILEFLIGHT_REQUIRE_TEST_DATA(folder, "tilesets/cesiumjs_specs_data/Batched");
  for (const char* name : {"BatchedWithBatchTable", "BatchedWithBatchTableBinary"}) {
    LoadOptions options;
    const LoadedTiles tiles = load_region((folder / name / "tileset.json").string(), options);
    std::set<std::uint32_t> ids;
    for (const TexturedMesh& mesh : tiles.meshes) {
      ASSERT_NE(mesh.features, nullptr);
      EXPECT_EQ(mesh.features->count, 10U);
      EXPECT_EQ(mesh.feature_ids.size(), mesh.mesh.vertices.size());
      ids.insert(mesh.feature_ids.begin(), mesh.feature_ids.end());
      EXPECT_EQ(mesh.features->properties.at("Height").size(), 10U);
    }
    EXPECT_EQ(ids.size(), 10U);
    EXPECT_EQ(*ids.rbegin(), 9U);
  }
}

}  // namespace
}  // namespace tileflight::tileset::features_test
