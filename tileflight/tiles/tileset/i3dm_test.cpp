#include "tileflight/tiles/tile_content/i3dm.h"

#include <gmock/gmock.h>

#include <nlohmann/json.hpp>

#include "tests/test_data.h"
#include "tileflight/core/geometry/geodesy.h"
#include "tileflight/tiles/fetch/test_tilesets.h"
#include "tileflight/tiles/tileset/load.h"

namespace tileflight::tileset::i3dm_test {
namespace {

using base::test_support::error_of;
using base::test_support::to_raw_bytes;
using fetch::test_support::Json;
using geometry::Vec3;
using ::testing::Each;
using ::testing::HasSubstr;

/// A triangle (0 0 0), (1 0 0), (0 1 0) in the tile's frame: the y-up model becomes horizontal when rotated to z-up.
std::string flat_triangle() { return fetch::test_support::triangle_glb({0, 0, 0, 1, 0, 0, 0, 0, -1}); }

std::string i3dm(const fetch::test_support::Tables& tables, const std::string& body = flat_triangle(),
                 std::uint32_t format = 1) {
  return fetch::test_support::container("i3dm", tables, body, fetch::test_support::GltfWriter::u32(format));
}

tile_content::DecodedContent read(const std::string& bytes, const tile_content::ContentOptions& options = {}) {
  return tile_content::decode_content(base::test_support::to_bytes(bytes), "i", options);
}

void expect_corners(const imaging::TexturedMesh& mesh, const std::array<Vec3, 3>& corners) {
  ASSERT_EQ(mesh.mesh.vertices.size(), 3U);
  for (std::size_t i = 0; i < 3; ++i) {
    EXPECT_LT((mesh.mesh.vertices[i] - corners[i]).norm(), 1e-3) << mesh.mesh.vertices[i].transpose();
  }
}

TEST(I3dm, PlacesScalesAndTurns) {
  const std::string positions = base::test_support::to_raw_bytes<float>({10, 0, 0, 0, 20, 0});
  const std::string up =
      base::test_support::to_raw_bytes<float>({0, 1, 0, 0, 0, 1});  // the second one stands: its y points up
  const std::string right = base::test_support::to_raw_bytes<float>({1, 0, 0, 1, 0, 0});
  const std::string scale = base::test_support::to_raw_bytes<float>({1, 3});
  const tile_content::DecodedContent content = read(i3dm({{{"INSTANCES_LENGTH", 2},
                                                           {"POSITION", {{"byteOffset", 0}}},
                                                           {"NORMAL_UP", {{"byteOffset", 24}}},
                                                           {"NORMAL_RIGHT", {{"byteOffset", 48}}},
                                                           {"SCALE", {{"byteOffset", 72}}},
                                                           {"RTC_CENTER", {0, 0, 100}}},
                                                          positions + up + right + scale}));
  ASSERT_EQ(content.meshes.size(), 2U);
  expect_corners(content.meshes[0], {Vec3(10, 0, 100), Vec3(11, 0, 100), Vec3(10, 1, 100)});
  expect_corners(content.meshes[1], {Vec3(0, 20, 100), Vec3(3, 20, 100), Vec3(0, 20, 103)});
  EXPECT_THAT(content.meshes[1].feature_ids, Each(1U));
}

TEST(I3dm, QuantisedPlacesAndOctahedralDirections) {
  const std::string positions = base::test_support::to_raw_bytes<std::uint16_t>({65535, 0, 0});
  // Octahedral +z is the middle, +x the right end of the middle row.
  const std::string up = base::test_support::to_raw_bytes<std::uint16_t>({32768, 32768});
  const std::string right = base::test_support::to_raw_bytes<std::uint16_t>({65535, 32768});
  const tile_content::DecodedContent content = read(i3dm({{{"INSTANCES_LENGTH", 1},
                                                           {"POSITION_QUANTIZED", {{"byteOffset", 0}}},
                                                           {"QUANTIZED_VOLUME_OFFSET", {0, 5, 0}},
                                                           {"QUANTIZED_VOLUME_SCALE", {10, 1, 1}},
                                                           {"NORMAL_UP_OCT32P", {{"byteOffset", 8}}},
                                                           {"NORMAL_RIGHT_OCT32P", {{"byteOffset", 12}}},
                                                           {"SCALE_NON_UNIFORM", {2, 4, 1}}},
                                                          positions + "  " + up + right}));
  expect_corners(content.meshes.at(0), {Vec3(10, 5, 0), Vec3(12, 5, 0), Vec3(10, 5, 4)});
}

TEST(I3dm, EastNorthUpOfItsPlace) {
  const geometry::LocalFrame frame({35.31, -80.74, {200}});
  const Vec3 place = frame.T_ecef_local().translation;
  const tile_content::DecodedContent content = read(i3dm({{{"INSTANCES_LENGTH", 1},
                                                           {"POSITION", {0, 0, 0}},
                                                           {"RTC_CENTER", {place.x(), place.y(), place.z()}},
                                                           {"EAST_NORTH_UP", true}},
                                                          ""}));
  expect_corners(content.meshes.at(0),
                 {place, frame.T_ecef_local() * Vec3(1, 0, 0), frame.T_ecef_local() * Vec3(0, 1, 0)});
}

TEST(I3dm, BatchIdsNameTheInstances) {
  const tile_content::DecodedContent content = read(i3dm(
      {{{"INSTANCES_LENGTH", 2},
        {"POSITION", {0, 0, 0, 5, 0, 0}},
        {"BATCH_ID", {{"byteOffset", 0}, {"componentType", "UNSIGNED_BYTE"}}}},
       base::test_support::to_raw_bytes<std::uint8_t>({1, 0}),
       {{"name", {"oak", "lime"}}, {"height", {{"byteOffset", 0}, {"componentType", "FLOAT"}, {"type", "SCALAR"}}}},
       base::test_support::to_raw_bytes<float>({12.5F, 7})}));
  const imaging::TexturedMesh& first = content.meshes.at(0);
  EXPECT_EQ(first.features->name(first.feature_ids[0]), "lime");
  EXPECT_EQ(first.features->properties.at("height")[0], "12.5");
}

TEST(I3dm, AModelAtAUriAndItsOwnFiles) {
  tile_content::ContentOptions options;
  std::vector<std::string> asked;
  Json gltf = Json::parse(R"({"asset":{"version":"2.0"},"scenes":[{"nodes":[0]}],"nodes":[{"mesh":0}],
      "meshes":[{"primitives":[{"attributes":{"POSITION":0}}]}],
      "accessors":[{"bufferView":0,"componentType":5126,"type":"VEC3","count":3}],
      "bufferViews":[{"buffer":0,"byteLength":36}],"buffers":[{"uri":"tree.bin","byteLength":36}]})");
  options.read_resource = [&](const std::string& uri) {
    asked.push_back(uri);
    return base::test_support::to_bytes(uri == "models/tree.gltf"
                                            ? gltf.dump()
                                            : base::test_support::to_raw_bytes<float>({0, 0, 0, 1, 0, 0, 0, 0, -1}));
  };
  const Json table = {{"INSTANCES_LENGTH", 1}, {"POSITION", {1, 2, 3}}};
  const tile_content::DecodedContent content = read(i3dm({table}, "models/tree.gltf   ", 0), options);
  expect_corners(content.meshes.at(0), {Vec3(1, 2, 3), Vec3(2, 2, 3), Vec3(1, 3, 3)});
  EXPECT_THAT(asked, ::testing::ElementsAre("models/tree.gltf", "models/tree.bin"));
  EXPECT_THAT(base::test_support::error_of([&] { read(i3dm({table}, "models/tree.gltf", 0)); }),
              HasSubstr("another file"));
}

TEST(I3dm, FaultsAreNamed) {
  const auto message = [](const fetch::test_support::Tables& tables, const std::string& body = flat_triangle(),
                          std::uint32_t format = 1, const tile_content::ContentOptions& options = {}) {
    return base::test_support::error_of([&] { read(i3dm(tables, body, format), options); });
  };
  EXPECT_THAT(message({}), HasSubstr("INSTANCES_LENGTH is missing"));
  EXPECT_THAT(message({{{"INSTANCES_LENGTH", 1}}}), HasSubstr("no POSITION"));
  EXPECT_THAT(message({{{"INSTANCES_LENGTH", 4000000000U}, {"POSITION", {{"byteOffset", 0}}}}}),
              HasSubstr("positions"));
  EXPECT_THAT(message({{{"INSTANCES_LENGTH", 1}, {"POSITION", {0, 0, 0}}}}, "nothing"), HasSubstr("is not glTF"));
  EXPECT_THAT(message({{{"INSTANCES_LENGTH", 1}, {"POSITION", {0, 0, 0}}}}, flat_triangle(), 3),
              HasSubstr("gltfFormat is 3"));
  EXPECT_THAT(message({{{"INSTANCES_LENGTH", 1}, {"POSITION", {0, 0, 0}}}}, "", 0), HasSubstr("has no model URI"));
  tile_content::ContentOptions few;
  few.limits.max_vertices = 5;
  EXPECT_THAT(message({{{"INSTANCES_LENGTH", 2}, {"POSITION", {0, 0, 0, 0, 0, 0}}}}, flat_triangle(), 1, few),
              HasSubstr("exceed the limits"));
  // A model must not contain tiles.
  const std::string inner = i3dm({{{"INSTANCES_LENGTH", 1}, {"POSITION", {0, 0, 0}}}});
  EXPECT_THAT(message({{{"INSTANCES_LENGTH", 1}, {"POSITION", {0, 0, 0}}}}, inner), HasSubstr("is not glTF"));
}

/// Cesium's instanced tilesets: 25 models in five rows around one location, in all encodings.
TEST(I3dm, RealInstancesStandInOnePlace) {
  TILEFLIGHT_REQUIRE_TEST_DATA(folder, "tilesets/cesiumjs_specs_data/Instanced");
  int read = 0;
  LoadOptions options;
  options.textures = false;
  for (const char* name :
       {"InstancedOct32POrientation", "InstancedOrientation", "InstancedQuantized", "InstancedRTC",
        "InstancedQuantizedOct32POrientation", "InstancedScale", "InstancedScaleNonUniform", "InstancedWithBatchIds",
        "InstancedWithBatchTable", "InstancedWithTransform", "InstancedWithoutBatchTable", "InstancedGltfExternal"}) {
    SCOPED_TRACE(name);
    const LoadedTiles tiles = load_region((folder / name / "tileset.json").string(), options);
    geometry::Box3 box;
    for (const imaging::TexturedMesh& mesh : tiles.meshes) box.extend(geometry::bounds(mesh.mesh));
    EXPECT_EQ(tiles.meshes.size() % 25, 0U);
    EXPECT_GE(tiles.meshes.size(), 25U);
    EXPECT_LT((box.center() - tiles.region.box().center()).norm(), 60);
    EXPECT_LT(box.sizes().maxCoeff(), 250);
    ++read;
  }
  EXPECT_EQ(read, 12);
}

}  // namespace
}  // namespace tileflight::tileset::i3dm_test
