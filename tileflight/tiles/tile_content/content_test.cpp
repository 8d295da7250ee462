#include "tileflight/tiles/tile_content/content.h"

#include <gmock/gmock.h>
#include <meshoptimizer.h>

#include <cmath>
#include <numbers>
#include <set>

#include "tileflight/core/base/raw_bytes.h"
#include "tileflight/core/base/srgb.h"
#include "tileflight/core/imaging/image_files.h"
#include "tileflight/tiles/fetch/test_tilesets.h"
#include "tileflight/tiles/tile_content/alpha_cutout.h"

namespace tileflight::tile_content::content_test {
namespace {

using base::test_support::error_of;
using base::test_support::to_bytes;
using fetch::test_support::b3dm;
using fetch::test_support::GltfWriter;
using fetch::test_support::Json;
using fetch::test_support::triangle_glb;
using geometry::Vec3;
using imaging::TexturedMesh;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

DecodedContent decode(const std::string& bytes, const ContentOptions& options = {}) {
  return decode_content(base::test_support::to_bytes(bytes), "tile", options);
}

/// The only mesh of a content.
TexturedMesh mesh_of(const std::string& bytes, const ContentOptions& options = {}) {
  DecodedContent content = decode(bytes, options);
  EXPECT_EQ(content.meshes.size(), 1U);
  return content.meshes.at(0);
}

std::string error(const std::string& bytes, const ContentOptions& options = {}) {
  return base::test_support::error_of([&] { decode(bytes, options); });
}

TEST(DecodeContent, YUpBecomesZUp) {
  const std::string glb = fetch::test_support::triangle_glb({1, 2, 3, 4, 5, 6, 7, 8, 10});
  const TexturedMesh mesh = mesh_of(glb);
  EXPECT_THAT(mesh.mesh.vertices, ElementsAre(Vec3(1, -3, 2), Vec3(4, -6, 5), Vec3(7, -10, 8)));
  EXPECT_THAT(mesh.mesh.triangles, ElementsAre(geometry::Triangle{0, 1, 2}));
  EXPECT_EQ(mesh_of(glb, {.up_axis = UpAxis::kZ}).mesh.vertices[0], Vec3(1, 2, 3));
  EXPECT_EQ(mesh_of(glb, {.up_axis = UpAxis::kX}).mesh.vertices[0], Vec3(-3, 2, 1));
}

TEST(DecodeContent, RtcCentersAreAddedAfterTheTurn) {
  const std::string glb = fetch::test_support::triangle_glb({1, 2, 3, 4, 5, 6, 7, 8, 10});
  EXPECT_EQ(
      mesh_of(fetch::test_support::b3dm(glb, {{"BATCH_LENGTH", 0}, {"RTC_CENTER", {1e6, 2e6, 3e6}}})).mesh.vertices[0],
      Vec3(1e6 + 1, 2e6 - 3, 3e6 + 2));
  GltfWriter writer;
  writer.add_primitive({{"attributes", {{"POSITION", writer.add_accessor<float>({1, 2, 3, 4, 5, 6, 7, 8, 10}, 3)}}}});
  writer.json()["extensions"]["CESIUM_RTC"]["center"] = {1e6, 2e6, 3e6};
  writer.json()["extensionsRequired"] = {"CESIUM_RTC"};
  EXPECT_EQ(mesh_of(writer.glb()).mesh.vertices[0], Vec3(1e6 + 1, 2e6 - 3, 3e6 + 2));
  EXPECT_THAT(error(fetch::test_support::b3dm(glb, {{"RTC_CENTER", {1, 2}}})),
              HasSubstr("RTC_CENTER has 2 numbers, expected 3"));
}

TEST(DecodeContent, EarlierB3dmHeaders) {
  const std::string glb = fetch::test_support::triangle_glb();
  const auto u32 = GltfWriter::u32;
  const std::string table = "{\"id\":[0]}  ";
  const auto length = [&](std::size_t header) {
    return u32(static_cast<std::uint32_t>(header + table.size() + glb.size()));
  };
  EXPECT_EQ(mesh_of("b3dm" + u32(1) + length(20) + u32(1) + u32(12) + table + glb).mesh.triangles.size(), 1U);
  EXPECT_EQ(mesh_of("b3dm" + u32(1) + length(24) + u32(12) + u32(0) + u32(1) + table + glb).mesh.triangles.size(), 1U);
}

TEST(DecodeContent, NodeTreesAndMirrors) {
  GltfWriter writer;
  Json& node = writer.add_primitive(
      {{"attributes", {{"POSITION", writer.add_accessor<float>({0, 0, 0, 1, 0, 0, 0, 1, 0}, 3)}}}});
  node["translation"] = {1, 0, 0};
  node["rotation"] = {0, 0, std::sin(std::numbers::pi / 4), std::cos(std::numbers::pi / 4)};  // x to y
  node["scale"] = {2, 3, 4};
  writer.json()["nodes"].push_back({{"children", {0}}, {"matrix", {-1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 5, 1}}});
  writer.json()["scenes"][0]["nodes"] = {1};
  const TexturedMesh mesh = mesh_of(writer.glb(), {.up_axis = UpAxis::kZ});
  EXPECT_LT((mesh.mesh.vertices[0] - Vec3(-1, 0, 5)).norm(), 1e-12);
  EXPECT_LT((mesh.mesh.vertices[1] - Vec3(-1, 2, 5)).norm(), 1e-12);
  EXPECT_LT((mesh.mesh.vertices[2] - Vec3(2, 0, 5)).norm(), 1e-12);
  EXPECT_THAT(mesh.mesh.triangles, ElementsAre(geometry::Triangle{0, 2, 1}));  // mirrored
}

TEST(DecodeContent, NodesFormATree) {
  GltfWriter writer;
  Json& node = writer.add_primitive(
      {{"attributes", {{"POSITION", writer.add_accessor<float>({0, 0, 0, 1, 0, 0, 0, 1, 0}, 3)}}}});
  node["children"] = {0};
  EXPECT_THAT(error(writer.glb()), HasSubstr("its own descendant"));
  node["children"] = {7};
  EXPECT_THAT(error(writer.glb()), HasSubstr("refers to a node that does not exist"));
}

TEST(DecodeContent, StripsFansAndListsWithAndWithoutIndices) {
  const auto triangles = [](int mode, const std::vector<std::uint16_t>& indices) {
    GltfWriter writer;
    Json primitive = {{"mode", mode},
                      {"attributes", {{"POSITION", writer.add_accessor(std::vector<float>(15, 1.0F), 3)}}}};
    if (!indices.empty()) primitive["indices"] = writer.add_accessor(indices, 1);
    writer.add_primitive(primitive);
    return mesh_of(writer.glb()).mesh.triangles;
  };
  using T = geometry::Triangle;
  EXPECT_THAT(triangles(4, {4, 3, 2, 1, 0, 2}), ElementsAre(T{4, 3, 2}, T{1, 0, 2}));
  EXPECT_THAT(triangles(4, {}), ElementsAre(T{0, 1, 2}));
  EXPECT_THAT(triangles(5, {}), ElementsAre(T{0, 1, 2}, T{1, 3, 2}, T{2, 3, 4}));
  EXPECT_THAT(triangles(5, {0, 1, 2, 2, 3, 3, 4}), ElementsAre(T{0, 1, 2}));  // stitched
  EXPECT_THAT(triangles(6, {}), ElementsAre(T{1, 2, 0}, T{2, 3, 0}, T{3, 4, 0}));
}

TEST(DecodeContent, QuantisedAttributesStridesAndColours) {
  GltfWriter writer;
  // Positions of 8 bytes a vertex (the last two are padding), normalised.
  const std::size_t positions =
      writer.add_accessor<std::int16_t>({0, 0, 0, 9, 32767, 0, 0, 9, 0, -32768, 0, 9}, 4, true);
  writer.json()["accessors"][positions]["type"] = "VEC3";
  writer.json()["bufferViews"][writer.json()["accessors"][positions]["bufferView"].get<std::size_t>()]["byteStride"] =
      8;
  const std::size_t colors = writer.add_accessor<std::uint8_t>({255, 0, 51, 0, 255, 0, 0, 0, 255}, 3, true);
  writer.add_primitive({{"attributes", {{"POSITION", positions}, {"COLOR_0", colors}}}});
  writer.json()["nodes"][0]["scale"] = {10, 10, 10};
  const TexturedMesh mesh = mesh_of(writer.glb(), {.up_axis = UpAxis::kZ});
  EXPECT_THAT(mesh.mesh.vertices, ElementsAre(Vec3(0, 0, 0), Vec3(10, 0, 0), Vec3(0, -10, 0)));
  ASSERT_EQ(mesh.colors.size(), 3U);
  EXPECT_THAT(mesh.colors[0], ElementsAre(255, 0, 51, 255));
}

TEST(DecodeContent, SparseAccessors) {
  GltfWriter writer;
  const std::size_t positions = writer.add_accessor(std::vector<float>{0, 0, 0, 1, 0, 0, 0, 1, 0}, 3);
  const std::size_t indices = writer.add_view<std::uint16_t>({2});
  const std::size_t values = writer.add_view<float>({7, 8, 9});
  Json sparse = {{"count", 1},
                 {"indices", {{"bufferView", indices}, {"componentType", 5123}}},
                 {"values", {{"bufferView", values}}}};
  writer.json()["accessors"][positions]["sparse"] = sparse;
  writer.add_primitive({{"attributes", {{"POSITION", positions}}}});
  const ContentOptions z_up{.up_axis = UpAxis::kZ};
  EXPECT_THAT(mesh_of(writer.glb(), z_up).mesh.vertices, ElementsAre(Vec3(0, 0, 0), Vec3(1, 0, 0), Vec3(7, 8, 9)));
  writer.json()["accessors"][positions].erase("bufferView");
  EXPECT_THAT(mesh_of(writer.glb(), z_up).mesh.vertices, ElementsAre(Vec3(0, 0, 0), Vec3(0, 0, 0), Vec3(7, 8, 9)));
  writer.json()["accessors"][positions]["count"] = 2;
  EXPECT_THAT(error(writer.glb()), HasSubstr("sparse index lies outside"));
}

TEST(DecodeContent, SparseIndices) {
  GltfWriter writer;
  const std::size_t positions = writer.add_accessor(std::vector<float>(15, 1.0F), 3);
  const std::size_t corners = writer.add_accessor<std::uint16_t>({0, 1, 2, 2, 1, 3}, 1);
  const std::size_t places = writer.add_view<std::uint8_t>({0, 5});
  const std::size_t values = writer.add_view<std::uint16_t>({3, 4});
  writer.json()["accessors"][corners]["sparse"] = {{"count", 2},
                                                   {"indices", {{"bufferView", places}, {"componentType", 5121}}},
                                                   {"values", {{"bufferView", values}}}};
  writer.add_primitive({{"attributes", {{"POSITION", positions}}}, {"indices", corners}});
  using T = geometry::Triangle;
  EXPECT_THAT(mesh_of(writer.glb()).mesh.triangles, ElementsAre(T{3, 1, 2}, T{2, 1, 4}));
  writer.json()["accessors"][corners].erase("bufferView");
  EXPECT_THAT(mesh_of(writer.glb()).mesh.triangles, ElementsAre(T{3, 0, 0}, T{0, 0, 4}));
  writer.json()["accessors"][corners]["count"] = 3;
  EXPECT_THAT(error(writer.glb()), HasSubstr("sparse index lies outside"));
}

/// A textured triangle; the texture is 2 x 1 pixels, red and blue.
GltfWriter textured_triangle() {
  imaging::RgbImage image(2, 1);
  image(0, 0) = {255, 0, 0};
  image(1, 0) = {0, 0, 255};
  GltfWriter writer;
  writer.json()["images"] = {{{"bufferView", writer.add_view(imaging::encode_png(image))}, {"mimeType", "image/png"}}};
  writer.json()["samplers"] = {{{"wrapS", 33071}, {"wrapT", 33648}}};
  writer.json()["textures"] = {{{"source", 0}, {"sampler", 0}}};
  writer.json()["materials"] = {
      {{"pbrMetallicRoughness", {{"baseColorTexture", {{"index", 0}}}, {"baseColorFactor", {0.5, 0.25, 1, 1}}}}}};
  const std::size_t positions = writer.add_accessor(std::vector<float>{0, 0, 0, 1, 0, 0, 0, 1, 0}, 3);
  const std::size_t uv = writer.add_accessor<std::uint16_t>({0, 0, 65535, 0, 0, 65535}, 2, true);
  writer.add_primitive({{"attributes", {{"POSITION", positions}, {"TEXCOORD_0", uv}}}, {"material", 0}});
  return writer;
}

TEST(DecodeContent, Textures) {
  const std::string glb = textured_triangle().glb();
  const TexturedMesh mesh = mesh_of(glb);
  ASSERT_NE(mesh.texture, nullptr);
  EXPECT_EQ((*mesh.texture)(1, 0), (imaging::Rgb8{0, 0, 255}));
  EXPECT_EQ(mesh.wrap_u, imaging::Wrap::kClampToEdge);
  EXPECT_EQ(mesh.wrap_v, imaging::Wrap::kMirroredRepeat);
  EXPECT_THAT(mesh.base_color, ElementsAre(0.5F, 0.25F, 1.0F, 1.0F));
  EXPECT_THAT(mesh.uv, ElementsAre(Eigen::Vector2f(0, 0), Eigen::Vector2f(1, 0), Eigen::Vector2f(0, 1)));
  const TexturedMesh bare = mesh_of(glb, {.textures = false});
  EXPECT_EQ(bare.texture, nullptr);
  EXPECT_TRUE(bare.uv.empty());
}

TEST(DecodeContent, TextureTransforms) {
  GltfWriter writer = textured_triangle();
  writer.json()["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"]["extensions"]["KHR_texture_transform"] = {
      {"offset", {0.25, 0.5}}, {"scale", {2, 3}}, {"rotation", std::numbers::pi / 2}};
  const TexturedMesh mesh = mesh_of(writer.glb());
  // (u, v) -> offset + (3 v, -2 u): a quarter turn counter-clockwise where v points down.
  EXPECT_LT((mesh.uv[1] - Eigen::Vector2f(0.25F, -1.5F)).norm(), 1e-6);
  EXPECT_LT((mesh.uv[2] - Eigen::Vector2f(3.25F, 0.5F)).norm(), 1e-6);
}

TEST(DecodeContent, ImagesInUnknownFormatsAreRefusedOnlyWhereTheyAreWanted) {
  GltfWriter writer = textured_triangle();
  writer.json()["textures"] = {{{"extensions", {{"MSFT_texture_dds", {{"source", 0}}}}}}};
  EXPECT_THAT(error(writer.glb()), HasSubstr("MSFT_texture_dds"));
  writer.json()["extensionsRequired"] = {"MSFT_texture_dds"};
  EXPECT_THAT(error(writer.glb()), HasSubstr("needs the glTF extension MSFT_texture_dds"));
  EXPECT_EQ(error(writer.glb(), {.textures = false}), "");
}

TEST(DecodeContent, OutsideFilesComeThroughTheReaders) {
  GltfWriter writer;
  writer.add_primitive({{"attributes", {{"POSITION", writer.add_accessor<float>({1, 2, 3, 4, 5, 6, 7, 8, 10}, 3)}}}});
  writer.json()["buffers"] = {{{"uri", "a%20b.bin"}, {"byteLength", 36}}};
  const std::string gltf = writer.json().dump();
  EXPECT_THAT(error(gltf), HasSubstr("refers to another file"));
  ContentOptions options{.up_axis = UpAxis::kZ};
  options.read_resource = [&](const std::string& uri) {
    EXPECT_EQ(uri, "a%20b.bin");
    return base::test_support::to_bytes(writer.binary());
  };
  EXPECT_EQ(mesh_of(gltf, options).mesh.vertices[2], Vec3(7, 8, 10));
  options.read_resource = [&](const std::string&) { return base::test_support::to_bytes(writer.binary().substr(1)); };
  EXPECT_THAT(error(gltf, options), HasSubstr("has 35 bytes of 36"));
}

TEST(DecodeContent, Instances) {
  GltfWriter writer;
  Json& node = writer.add_primitive(
      {{"attributes", {{"POSITION", writer.add_accessor<float>({0, 0, 0, 1, 0, 0, 0, 1, 0}, 3)}}}});
  const std::size_t translations = writer.add_accessor<float>({1, 0, 0, 2, 0, 0}, 3);
  const std::size_t scales = writer.add_accessor<float>({1, 1, 1, 3, 3, 3}, 3);
  node["extensions"]["EXT_mesh_gpu_instancing"]["attributes"] = {{"TRANSLATION", translations}, {"SCALE", scales}};
  const DecodedContent content = decode(writer.glb(), {.up_axis = UpAxis::kZ});
  ASSERT_EQ(content.meshes.size(), 2U);
  EXPECT_EQ(content.meshes[0].mesh.vertices[1], Vec3(2, 0, 0));
  EXPECT_EQ(content.meshes[1].mesh.vertices[1], Vec3(5, 0, 0));
}

TEST(DecodeContent, Composites) {
  const auto u32 = GltfWriter::u32;
  const std::string inner =
      fetch::test_support::b3dm(fetch::test_support::triangle_glb()) + fetch::test_support::triangle_glb();
  const auto composite = [&](const std::string& tiles, std::uint32_t count) {
    return "cmpt" + u32(1) + u32(static_cast<std::uint32_t>(16 + tiles.size())) + u32(count) + tiles;
  };
  EXPECT_EQ(decode(composite(inner, 2)).meshes.size(), 2U);
  EXPECT_EQ(decode(composite(composite(inner, 2) + inner, 3)).meshes.size(), 4U);
  EXPECT_THAT(error(composite(inner, 3)), HasSubstr("inner tile 2: truncated"));
  std::string nested = fetch::test_support::triangle_glb();
  for (int i = 0; i < 12; ++i) nested = composite(nested, 1);
  EXPECT_THAT(error(nested), HasSubstr("too deep"));
}

/// Oracle for the compressed form: the library's encoder; the values are known.
TEST(DecodeContent, MeshoptCompression) {
  std::vector<float> positions;
  for (int i = 0; i < 100; ++i)
    positions.insert(positions.end(), {static_cast<float>(i % 10), static_cast<float>(i / 10), 0.5F});
  std::vector<unsigned int> indices;
  for (unsigned i = 0; i < 9; ++i) {
    for (unsigned j = 0; j < 9; ++j) {
      const unsigned a = 10 * i + j;
      indices.insert(indices.end(), {a, a + 1, a + 10, a + 1, a + 11, a + 10});
    }
  }
  std::vector<unsigned char> packed_vertices(meshopt_encodeVertexBufferBound(100, 12));
  packed_vertices.resize(
      meshopt_encodeVertexBuffer(packed_vertices.data(), packed_vertices.size(), positions.data(), 100, 12));
  std::vector<unsigned char> packed_indices(meshopt_encodeIndexBufferBound(indices.size(), 100));
  packed_indices.resize(
      meshopt_encodeIndexBuffer(packed_indices.data(), packed_indices.size(), indices.data(), indices.size()));

  GltfWriter writer;
  const auto add = [&](const std::vector<unsigned char>& packed, std::size_t count, std::size_t stride,
                       const char* mode) {
    const std::size_t view = writer.add_view(packed);
    Json& json = writer.json()["bufferViews"][view];
    json["extensions"]["EXT_meshopt_compression"] = {{"buffer", 0},          {"byteOffset", json["byteOffset"]},
                                                     {"count", count},       {"byteLength", packed.size()},
                                                     {"byteStride", stride}, {"mode", mode}};
    json["byteLength"] = count * stride;
    json["buffer"] = 0;
    return view;
  };
  const std::size_t vertex_view = add(packed_vertices, 100, 12, "ATTRIBUTES");
  const std::size_t index_view = add(packed_indices, indices.size(), 4, "TRIANGLES");
  writer.json()["accessors"] = {
      {{"bufferView", vertex_view}, {"componentType", 5126}, {"type", "VEC3"}, {"count", 100}},
      {{"bufferView", index_view}, {"componentType", 5125}, {"type", "SCALAR"}, {"count", indices.size()}}};
  writer.add_primitive({{"attributes", {{"POSITION", 0}}}, {"indices", 1}});
  writer.json()["extensionsRequired"] = {"EXT_meshopt_compression"};
  const TexturedMesh mesh = mesh_of(writer.glb(), {.up_axis = UpAxis::kZ});
  ASSERT_EQ(mesh.mesh.vertices.size(), 100U);
  EXPECT_EQ(mesh.mesh.vertices[57], Vec3(7, 5, 0.5));
  EXPECT_EQ(mesh.mesh.triangles.size(), 162U);
  EXPECT_NEAR(geometry::surface_area_m2(mesh.mesh), 81, 1e-9);

  Json& extension = writer.json()["bufferViews"][vertex_view]["extensions"]["EXT_meshopt_compression"];
  extension["byteStride"] = 10;
  EXPECT_THAT(error(writer.glb()), HasSubstr("do not match"));
  extension["byteStride"] = 12;
  extension["count"] = 1e12;
  EXPECT_THAT(error(writer.glb()), HasSubstr("limit on decompressed bytes"));
  extension["count"] = 100;
  extension["byteLength"] = packed_vertices.size() - 5;
  EXPECT_THAT(error(writer.glb()), HasSubstr("malformed"));
}

/// A view in the compressed form, `count` elements of `stride` bytes.
std::size_t add_meshopt(GltfWriter& writer, const std::vector<unsigned char>& packed, std::size_t count,
                        std::size_t stride, const char* mode, const char* filter = "NONE") {
  const std::size_t view = writer.add_view(packed);
  Json& json = writer.json()["bufferViews"][view];
  json["extensions"]["EXT_meshopt_compression"] = {{"buffer", 0},          {"byteOffset", json["byteOffset"]},
                                                   {"count", count},       {"byteLength", packed.size()},
                                                   {"byteStride", stride}, {"mode", mode},
                                                   {"filter", filter}};
  json["byteLength"] = count * stride;
  return view;
}

/// Index sequences of 16 and 32 bits, and positions through the exponential filter.
TEST(DecodeContent, MeshoptSequencesAndTheExponentialFilter) {
  const std::vector<float> positions = {0, 0, 0, 1.5F, 0, 0, 0, -2.25F, 0, 1000, 0.125F, 3};
  std::vector<unsigned char> filtered(positions.size() * 4);
#if MESHOPTIMIZER_VERSION >= 190
  meshopt_encodeFilterExp(filtered.data(), 4, 12, 20, positions.data(), meshopt_EncodeExpSharedVector);
#else
  meshopt_encodeFilterExp(filtered.data(), 4, 12, 20, positions.data());
#endif
  std::vector<unsigned char> packed(meshopt_encodeVertexBufferBound(4, 12));
  packed.resize(meshopt_encodeVertexBuffer(packed.data(), packed.size(), filtered.data(), 4, 12));
  const std::vector<unsigned int> corners = {2, 1, 0, 3, 1, 2, 0};
  std::vector<unsigned char> sequence(meshopt_encodeIndexSequenceBound(corners.size(), 4));
  sequence.resize(meshopt_encodeIndexSequence(sequence.data(), sequence.size(), corners.data(), corners.size()));
  for (const std::size_t bytes : {2U, 4U}) {
    GltfWriter writer;
    const std::size_t vertices = add_meshopt(writer, packed, 4, 12, "ATTRIBUTES", "EXPONENTIAL");
    const std::size_t strip = add_meshopt(writer, sequence, corners.size(), bytes, "INDICES");
    writer.json()["accessors"] = {
        {{"bufferView", vertices}, {"componentType", 5126}, {"type", "VEC3"}, {"count", 4}},
        {{"bufferView", strip}, {"componentType", bytes == 2 ? 5123 : 5125}, {"type", "SCALAR"}, {"count", 7}}};
    writer.add_primitive({{"mode", 5}, {"attributes", {{"POSITION", 0}}}, {"indices", 1}});
    const TexturedMesh mesh = mesh_of(writer.glb(), {.up_axis = UpAxis::kZ});
    using T = geometry::Triangle;
    EXPECT_THAT(mesh.mesh.triangles, ElementsAre(T{2, 1, 0}, T{1, 3, 0}, T{0, 3, 1}, T{3, 2, 1}, T{1, 2, 0}));
    for (std::size_t i = 0; i < 4; ++i) {
      for (std::size_t c = 0; c < 3; ++c)
        EXPECT_NEAR(mesh.mesh.vertices[i][static_cast<int>(c)], positions[3 * i + c], 2e-3);
    }
  }
}

TEST(DecodeContent, CutShortAtEveryLength) {
  for (const std::string& whole : {fetch::test_support::b3dm(textured_triangle().glb()), textured_triangle().glb()}) {
    EXPECT_EQ(error(whole), "");
    for (std::size_t length = 0; length < whole.size(); ++length) {
      EXPECT_THAT(error(whole.substr(0, length)), ::testing::StartsWith("tile: ")) << length;
    }
  }
}

TEST(DecodeContent, WhatIsNoTileIsToldApart) {
  EXPECT_THAT(error(""), HasSubstr("is empty"));
  EXPECT_THAT(error("\n<!DOCTYPE html><html>404</html>"), HasSubstr("web page (HTML)"));
  EXPECT_THAT(error("garbage garbage"), HasSubstr("no known format"));
  EXPECT_THAT(error("\x1f\x8b garbage"), HasSubstr("gzip"));
  EXPECT_THAT(error("vctr...."), HasSubstr("vctr contents are not supported"));
  EXPECT_THAT(error("PK\x03\x04...."), HasSubstr("archive (.3tz) contents are not supported"));
  EXPECT_THAT(error("{\"asset\":{\"version\":\"1.0\"}}"), HasSubstr("glTF version '1.0' is not supported"));
  EXPECT_THAT(error("glTF" + GltfWriter::u32(1) + std::string(40, ' ')), HasSubstr("glTF version 1 is not supported"));
  EXPECT_THAT(error("b3dm" + GltfWriter::u32(2) + GltfWriter::u32(28) + std::string(40, ' ')),
              HasSubstr("b3dm version 2"));
}

/// Each fault in an otherwise valid file and a word of the expected message; `path` is a JSON pointer into the glTF.
TEST(DecodeContent, NamesEachFault) {
  struct Fault {
    const char* path;
    Json value;
    const char* message;
  };
  const Fault faults[] = {
      {"/accessors/0/count", 4, "accessors[0]: needs 48 bytes, its bufferView has 36"},
      {"/accessors/0/count", 1e15, "accessors[0]: needs"},
      {"/accessors/0/count", -1, "count is not a whole number"},
      {"/accessors/0/count", 1.5, "count is not a whole number"},
      {"/accessors/0/byteOffset", 1e15, "accessors[0]: needs"},
      {"/accessors/0/bufferView", 99, "bufferView 99 does not exist"},
      {"/accessors/0/componentType", 1, "componentType 1"},
      {"/accessors/0/type", "VEC9", "type 'VEC9'"},
      {"/accessors/0/type", "VEC2", "has 2 components, expected 3"},
      {"/accessors/0", {{"componentType", 5126}, {"type", "VEC3"}, {"count", 1e14}}, "more zeros than the limit"},
      {"/accessors/1/count", 2, "TEXCOORD has 2 entries for 3 vertices"},
      {"/bufferViews/0/byteLength", 1e15, "lie outside its buffer"},
      {"/bufferViews/1/byteOffset", 1e15, "lie outside its buffer"},
      {"/bufferViews/0/buffer", 3, "buffer 3 does not exist"},
      {"/bufferViews/1/byteStride", 4, "its elements overlap"},
      {"/meshes/0/primitives/0/attributes/POSITION", 77, "POSITION 77 does not exist"},
      {"/meshes/0/primitives/0/mode", 9, "mode is not a whole number from 0 to 6"},
      {"/meshes/0/primitives/0/material", 9, "material 9 does not exist"},
      {"/meshes/0/primitives/0/indices", 0, "since it holds indices"},
      {"/meshes/0/primitives", 1, "primitives is number"},
      {"/nodes/0/mesh", 5, "mesh 5 does not exist"},
      {"/nodes/0/rotation", {0, 0, 0, 0}, "quaternion of length 0"},
      {"/nodes/0/matrix", {1}, "matrix has 1 numbers"},
      {"/nodes/0", 3, "nodes[0]: is not an object"},
      {"/scene", 4, "scene 4 does not exist"},
      {"/textures/0/source", 4, "source 4 does not exist"},
      {"/images/0", Json::object(), "no uri and no bufferView"},
      {"/images/0", {{"uri", "http://host/a.png"}}, "refers to another file"},
      {"/images/0/bufferView", 1, "images[0]"},
      {"/samplers/0/wrapS", 5, "wrap mode 5"},
      {"/extensionsRequired", {"ACME_secret"}, "needs the glTF extension ACME_secret"},
      {"/asset/version", "3.0", "glTF version '3.0'"},
  };
  for (const Fault& fault : faults) {
    GltfWriter writer = textured_triangle();
    writer.json()[Json::json_pointer(fault.path)] = fault.value;
    EXPECT_THAT(error(writer.glb()), HasSubstr(fault.message)) << fault.path;
  }
}

TEST(DecodeContent, IndicesBeyondTheVerticesAndPositionsThatAreNoNumbers) {
  GltfWriter writer;
  const std::size_t positions = writer.add_accessor<float>({0, 0, 0, 1, 0, 0, 0, 1, 0}, 3);
  writer.add_primitive(
      {{"attributes", {{"POSITION", positions}}}, {"indices", writer.add_accessor<std::uint32_t>({0, 1, 3}, 1)}});
  EXPECT_THAT(error(writer.glb()), HasSubstr("refers to vertex 3 of 3"));
  EXPECT_THAT(error(fetch::test_support::triangle_glb({0, 0, 0, 1, NAN, 0, 0, 1, 0})),
              HasSubstr("position of vertex 1 is not finite"));
  EXPECT_THAT(error(fetch::test_support::triangle_glb({0, 0, 0, 1, 0, INFINITY, 0, 1, 0})),
              HasSubstr("position of vertex 1 is not finite"));
}

/// A small file that unfolds into an enormous scene.
TEST(DecodeContent, LimitsHoldOverAllMeshesTogether) {
  GltfWriter writer;
  writer.add_primitive({{"attributes", {{"POSITION", writer.add_accessor<float>(std::vector<float>(3000, 1.0F), 3)}}}});
  for (int i = 0; i < 99; ++i) writer.json()["nodes"].push_back({{"mesh", 0}});
  writer.json().erase("scenes");
  writer.json().erase("scene");
  EXPECT_EQ(decode(writer.glb()).meshes.size(), 100U);
  ContentOptions options;
  options.limits.max_vertices = 50000;
  EXPECT_THAT(error(writer.glb(), options), HasSubstr("more than 50000 vertices"));
}

TEST(DecodeContent, LinesAreLeftOutWithAWarning) {
  GltfWriter writer;
  writer.add_primitive({{"mode", 1}, {"attributes", {{"POSITION", writer.add_accessor<float>({0, 0, 0}, 3)}}}});
  const DecodedContent content = decode(writer.glb());
  EXPECT_TRUE(content.meshes.empty());
  EXPECT_THAT(content.warnings, ElementsAre(HasSubstr("lines have no surface")));
}

/// 2 x 1 texels, the left one with alpha 0, the right one opaque.
constexpr const char* kHalfTransparent =
    "data:image/png;base64,"
    "iVBORw0KGgoAAAANSUhEUgAAAAIAAAABCAYAAAD0In+KAAAAEUlEQVR42mM4oaHBoHFC4z8ADJgDMENDLYAAAAAASUVORK5CYII=";
/// This image is the one above with alpha 100.
constexpr const char* kHalfDim =
    "data:image/png;base64,"
    "iVBORw0KGgoAAAANSUhEUgAAAAIAAAABCAYAAAD0In+KAAAAEUlEQVR42mM4oaGRonFC4z8ADowDlF+VhE8AAAAASUVORK5CYII=";

/// A square of side 1 with a texture that is shown `repeats` times along x, and this material.
DecodedContent square(const char* image, Json material, float repeats = 1.0F, bool textures = true) {
  fetch::test_support::GltfWriter writer;
  writer.json()["images"] = {{{"uri", image}}};
  writer.json()["textures"] = {{{"source", 0}}};
  material["pbrMetallicRoughness"]["baseColorTexture"] = {{"index", 0}};
  writer.json()["materials"] = Json::array({material});
  const std::vector<float> corners = {0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0};
  const std::vector<float> uv = {0, 0, repeats, 0, repeats, 1, 0, 1};
  writer.add_primitive(
      {{"attributes", {{"POSITION", writer.add_accessor(corners, 3)}, {"TEXCOORD_0", writer.add_accessor(uv, 2)}}},
       {"indices", writer.add_accessor(std::vector<std::uint16_t>{0, 1, 2, 0, 2, 3}, 1)},
       {"material", 0}});
  return decode_content(base::test_support::to_bytes(writer.glb()), "t.glb", {.textures = textures});
}

/// Area of all triangles, and the bounds of their vertices that triangles use.
double area_of(const DecodedContent& content, geometry::Box3* bounds = nullptr) {
  double area = 0.0;
  for (const imaging::TexturedMesh& mesh : content.meshes) {
    for (const geometry::Triangle& t : mesh.mesh.triangles) {
      const Vec3 &a = mesh.mesh.vertices[t[0]], &b = mesh.mesh.vertices[t[1]], &c = mesh.mesh.vertices[t[2]];
      area += (b - a).cross(c - a).norm() / 2;
      for (const Vec3& corner : {a, b, c})
        if (bounds != nullptr) bounds->extend(corner);
    }
  }
  return area;
}

/// Pictures, depth and ground truth use the same triangles, so what is cut out here is nowhere.
TEST(AlphaModes, MaskIsCutOutAlongTexels) {
  for (const bool textures : {true, false}) {
    geometry::Box3 bounds;
    const DecodedContent cut = square(kHalfTransparent, {{"alphaMode", "MASK"}}, 1.0F, textures);
    EXPECT_NEAR(area_of(cut, &bounds), 0.5, 1e-6);
    EXPECT_NEAR(bounds.min().x(), 0.5, 1e-6);
    EXPECT_NEAR(bounds.max().x(), 1.0, 1e-6);
    EXPECT_EQ(cut.meshes.at(0).texture != nullptr, textures);
  }
  EXPECT_NEAR(area_of(square(kHalfTransparent, {{"alphaMode", "MASK"}}, 3.0F)), 0.5, 1e-6) << "repeated";
  EXPECT_NEAR(area_of(square(kHalfTransparent, {{"alphaMode", "MASK"}}, 2.5F)), 0.4, 1e-6) << "the last one is cut off";
  EXPECT_NEAR(area_of(square(kHalfDim, {{"alphaMode", "MASK"}})), 0.5, 1e-6) << "100 / 255 is below 0.5";
  EXPECT_NEAR(area_of(square(kHalfDim, {{"alphaMode", "MASK"}, {"alphaCutoff", 0.3}})), 1.0, 1e-6);
  const Json half = {{"alphaMode", "MASK"}, {"pbrMetallicRoughness", {{"baseColorFactor", {1, 1, 1, 0.4}}}}};
  EXPECT_EQ(area_of(square(kHalfTransparent, half)), 0.0) << "0.4 x 1 is below 0.5";
}

TEST(AlphaModes, OpaqueSurfacesStayAsTheyAre) {
  for (const Json& material : {Json::object(), Json{{"alphaMode", "OPAQUE"}}}) {
    const DecodedContent content = square(kHalfTransparent, material);
    EXPECT_EQ(content.meshes.at(0).mesh.triangles.size(), 2U);
    EXPECT_EQ(content.meshes.at(0).mesh.vertices.size(), 4U);
    EXPECT_TRUE(content.warnings.empty());
  }
}

TEST(AlphaModes, BlendLeavesOutWhatIsWhollyTransparentAndNamesTheRest) {
  const DecodedContent clear = square(kHalfTransparent, {{"alphaMode", "BLEND"}});
  EXPECT_NEAR(area_of(clear), 0.5, 1e-6);
  EXPECT_THAT(clear.warnings, ElementsAre(HasSubstr("BLEND")));
  EXPECT_FALSE(clear.meshes.at(0).blends) << "what is left is opaque";
  const DecodedContent dim = square(kHalfDim, {{"alphaMode", "BLEND"}});
  EXPECT_NEAR(area_of(dim), 1.0, 1e-6);
  EXPECT_THAT(dim.warnings, ElementsAre(HasSubstr("BLEND")));
}

/// Also where no texel tells that the mode has an effect, and where textures are not read, as for the ground truth.
TEST(AlphaModes, BlendIsNamedWhateverDecidesTheOpacity) {
  for (const bool textures : {true, false}) {
    for (const char* image : {kHalfTransparent, kHalfDim}) {
      const DecodedContent blended = square(image, {{"alphaMode", "BLEND"}}, 1.0F, textures);
      EXPECT_THAT(blended.warnings, ElementsAre(HasSubstr("solid in depth, lidar and ground truth")));
    }
    const Json clear = {{"alphaMode", "BLEND"}, {"pbrMetallicRoughness", {{"baseColorFactor", {1, 1, 1, 0}}}}};
    const DecodedContent none = square(kHalfDim, clear, 1.0F, textures);
    EXPECT_TRUE(none.meshes.empty());
    EXPECT_THAT(none.warnings, ElementsAre(HasSubstr("BLEND"), HasSubstr("wholly transparent by their material")));
  }
}

/// The image that images blend by: its linear light is the opacity of the texels.
TEST(AlphaModes, BlendKeepsTheOpacityForImages) {
  const DecodedContent dim = square(kHalfDim, {{"alphaMode", "BLEND"}});
  EXPECT_TRUE(dim.meshes.at(0).blends);
  ASSERT_NE(dim.meshes.at(0).opacity, nullptr);
  const imaging::RgbImage& opacity = *dim.meshes.at(0).opacity;
  EXPECT_EQ(opacity.width, dim.meshes.at(0).texture->width);
  std::set<int> found;
  for (const imaging::Rgb8& texel : opacity.pixels)
    found.insert(static_cast<int>(std::lround(255.0 * base::linear_from_srgb(texel[0] / 255.0))));
  EXPECT_THAT(found, ElementsAre(100, 255));
  const Json factor = {{"alphaMode", "BLEND"}, {"pbrMetallicRoughness", {{"baseColorFactor", {1, 1, 1, 0.4}}}}};
  const DecodedContent plain = square(kHalfDim, factor, 1.0F, false);
  EXPECT_FALSE(plain.meshes.at(0).blends) << "geometry alone";
  EXPECT_FALSE(square(kHalfDim, {{"alphaMode", "MASK"}}).meshes.at(0).blends);
  EXPECT_FALSE(square(kHalfDim, Json::object()).meshes.at(0).blends);
}

/// The images above as KTX2 (Vulkan's format R8G8B8A8 with sRGB), as KHR_texture_basisu has them.
std::string ktx2_uri(int left_alpha) {
  const std::string pixels = {10, 20, 30, static_cast<char>(left_alpha), 40, 50, 60, '\xFF'};
  constexpr std::uint32_t kDescriptorAt = 80 + 24;
  constexpr std::uint32_t kDescriptorBytes = 28;
  const std::string file =
      std::string("\xABKTX 20\xBB\r\n\x1A\n", 12) +
      base::test_support::to_raw_bytes<std::uint32_t>(
          {43, 1, 2, 1, 0, 0, 1, 1, 0, kDescriptorAt, kDescriptorBytes, 0, 0}) +
      base::test_support::to_raw_bytes<std::uint64_t>({0, 0, kDescriptorAt + kDescriptorBytes, pixels.size(), 0}) +
      std::string(kDescriptorBytes, '\0') + pixels;
  return "data:image/ktx2;base64," + base::base64(file);
}

TEST(AlphaModes, OfTexturesInKtx2) {
  const std::string clear = ktx2_uri(0);
  const std::string dim = ktx2_uri(100);
  for (const bool textures : {true, false}) {
    const DecodedContent cut = square(clear.c_str(), {{"alphaMode", "MASK"}}, 1.0F, textures);
    EXPECT_NEAR(area_of(cut), 0.5, 1e-6);
    EXPECT_TRUE(cut.warnings.empty());
  }
  EXPECT_NEAR(area_of(square(dim.c_str(), {{"alphaMode", "MASK"}, {"alphaCutoff", 0.3}})), 1.0, 1e-6);
  EXPECT_NEAR(area_of(square(clear.c_str(), {{"alphaMode", "BLEND"}})), 0.5, 1e-6);
  const DecodedContent blended = square(dim.c_str(), {{"alphaMode", "BLEND"}});
  EXPECT_TRUE(blended.meshes.at(0).blends);
  EXPECT_NE(blended.meshes.at(0).opacity, nullptr);
  EXPECT_NEAR(area_of(square(clear.c_str(), Json::object())), 1.0, 1e-6);
}

/// Texture coordinates that repeat an image a million times must neither hang nor take much memory.
TEST(AlphaModes, TheNumberOfPiecesIsBounded) {
  const DecodedContent content = square(kHalfTransparent, {{"alphaMode", "MASK"}}, 1e6F);
  EXPECT_LT(content.meshes.at(0).mesh.triangles.size(), 1'000'000U);
  EXPECT_LT(area_of(square(kHalfTransparent, {{"alphaMode", "MASK"}}, 1e30F)), 1.1);
}

/// A surface of many triangles under a fine pattern: its pieces grow by a number that does not depend on the triangles,
/// since each costs memory and time in all that follows.
TEST(AlphaModes, PiecesOfManyTrianglesAreBounded) {
  constexpr int kTexels = 2048;
  constexpr std::uint32_t kSide = 200;
  imaging::GrayImage checkered(kTexels, kTexels);
  for (int y = 0; y < kTexels; ++y) {
    for (int x = 0; x < kTexels; ++x) checkered(x, y) = (x / 6 + y / 6) % 2 == 0 ? 255 : 0;
  }
  gltf::Geometry geometry;
  std::vector<Eigen::Vector2f> uv;
  for (std::uint32_t y = 0; y <= kSide; ++y) {
    for (std::uint32_t x = 0; x <= kSide; ++x) {
      uv.emplace_back(static_cast<float>(x) / kSide, static_cast<float>(y) / kSide);
      geometry.positions.insert(geometry.positions.end(), {uv.back().x(), uv.back().y(), 0.0F});
      geometry.tex_coords.insert(geometry.tex_coords.end(), {uv.back().x(), uv.back().y()});
      if (x == kSide || y == kSide) continue;
      const std::uint32_t corner = y * (kSide + 1) + x;
      geometry.triangles.push_back({corner, corner + 1, corner + kSide + 2});
      geometry.triangles.push_back({corner, corner + kSide + 2, corner + kSide + 1});
    }
  }
  const std::size_t triangles = geometry.triangles.size();
  EXPECT_GT(gltf::cut_out({.alpha = checkered}, uv, geometry), 1);
  EXPECT_LT(geometry.triangles.size(), triangles + 1'000'000);
}

TEST(Materials, WhatIsNotShownIsNamed) {
  const auto decode = [](const Json& material) {
    fetch::test_support::GltfWriter made;
    made.json()["materials"] = Json::array({material});
    const std::vector<float> corners = {0, 0, 0, 1, 0, 0, 0, 1, 0};
    made.add_primitive({{"attributes", {{"POSITION", made.add_accessor(corners, 3)}}}, {"material", 0}});
    return decode_content(base::test_support::to_bytes(made.glb()), "t.glb");
  };
  const DecodedContent shining =
      decode({{"emissiveFactor", {1, 0.5, 0}}, {"pbrMetallicRoughness", {{"baseColorFactor", {0, 0, 0, 1}}}}});
  EXPECT_EQ(shining.meshes.at(0).base_color, (std::array<float, 4>{1, 0.5, 0, 1}));
  EXPECT_THAT(shining.warnings, ElementsAre(HasSubstr("emissive")));
  const DecodedContent unknown = decode({{"extensions", {{"KHR_techniques_webgl", Json::object()}}}});
  EXPECT_THAT(unknown.warnings, ElementsAre(HasSubstr("KHR_techniques_webgl is ignored")));
  EXPECT_TRUE(decode({{"extensions", {{"KHR_materials_unlit", Json::object()}}}}).warnings.empty());
}

TEST(Materials, IntegerColoursWithoutNormalizedAreRead) {
  for (const bool normalized : {true, false}) {
    fetch::test_support::GltfWriter writer;
    const std::vector<float> corners = {0, 0, 0, 1, 0, 0, 0, 1, 0};
    const std::vector<std::uint8_t> colors = {51, 102, 204, 255, 51, 102, 204, 255, 51, 102, 204, 255};
    writer.add_primitive(
        {{"attributes",
          {{"POSITION", writer.add_accessor(corners, 3)}, {"COLOR_0", writer.add_accessor(colors, 4, normalized)}}}});
    const DecodedContent content = decode_content(base::test_support::to_bytes(writer.glb()), "t.glb");
    EXPECT_EQ(content.meshes.at(0).colors.at(1), (std::array<std::uint8_t, 4>{51, 102, 204, 255}));
    EXPECT_EQ(content.warnings.size(), normalized ? 0U : 1U);
  }
}

}  // namespace
}  // namespace tileflight::tile_content::content_test
