#include "tileflight/core/imaging/glb_writer.h"

#include <gtest/gtest.h>
#include <tiny_gltf.h>

#include <algorithm>
#include <cstring>
#include <memory>
#include <span>

#include "tileflight/core/base/noise.h"
#include "tileflight/core/imaging/image_files.h"
#include "tileflight/tiles/tile_content/content.h"

namespace tileflight::tile_content::glb_writer_test {
namespace {

using geometry::Vec3;
using imaging::TexturedMesh;

/// Images are kept as bytes: only the glTF is tested, not JPEG.
bool keep_bytes(tinygltf::Image* image, int, std::string*, std::string*, int, int, const unsigned char* bytes, int size,
                void*) {
  image->image.assign(bytes, bytes + size);
  return true;
}

tinygltf::Model read(const std::string& glb) {
  tinygltf::TinyGLTF reader;
  reader.SetImageLoader(keep_bytes, nullptr);
  tinygltf::Model model;
  std::string error, warning;
  EXPECT_TRUE(reader.LoadBinaryFromMemory(&model, &error, &warning, reinterpret_cast<const unsigned char*>(glb.data()),
                                          static_cast<unsigned>(glb.size())))
      << error;
  EXPECT_EQ(error + warning, "");
  return model;
}

template <class T>
std::vector<T> values(const tinygltf::Model& model, int accessor_index, std::size_t components) {
  const tinygltf::Accessor& accessor = model.accessors[static_cast<std::size_t>(accessor_index)];
  const tinygltf::BufferView& view = model.bufferViews[static_cast<std::size_t>(accessor.bufferView)];
  std::vector<T> out(accessor.count * components);
  std::memcpy(out.data(), model.buffers[0].data.data() + view.byteOffset, out.size() * sizeof(T));
  return out;
}

/// `count` random triangles around `center`.
TexturedMesh random_mesh(const Vec3& center, std::size_t count, std::shared_ptr<const imaging::RgbImage> texture,
                         std::uint32_t seed) {
  base::HashRandom random(seed);
  TexturedMesh mesh;
  for (std::uint32_t i = 0; i < 3 * count; ++i) {
    mesh.mesh.vertices.push_back(center +
                                 Vec3(random.uniform(-20, 20), random.uniform(-20, 20), random.uniform(-5, 5)));
    mesh.uv.emplace_back(static_cast<float>(random.uniform()), static_cast<float>(random.uniform()));
    if (i % 3 == 0) mesh.mesh.triangles.push_back({i, i + 1, i + 2});
  }
  mesh.texture = std::move(texture);
  return mesh;
}

TEST(GlbWriter, AnotherReaderGetsTheSameTriangles) {
  const auto texture = std::make_shared<imaging::RgbImage>(16, 8, imaging::Rgb8{200, 60, 20});
  const TexturedMesh mesh = random_mesh({150.3, -88.8, 12.1}, 200, texture, 1);
  const tinygltf::Model model = read(imaging::write_glb({mesh}, {90, "someone, CC0"}));
  EXPECT_EQ(model.asset.copyright, "someone, CC0");
  ASSERT_EQ(model.meshes.at(0).primitives.size(), 1U);
  const tinygltf::Primitive& primitive = model.meshes[0].primitives[0];
  const std::vector<double>& node = model.nodes.at(0).translation;
  const auto positions = values<float>(model, primitive.attributes.at("POSITION"), 3);
  const auto uv = values<std::uint16_t>(model, primitive.attributes.at("TEXCOORD_0"), 2);
  const auto indices = values<std::uint16_t>(model, primitive.indices, 1);
  ASSERT_EQ(indices.size(), 3 * mesh.mesh.triangles.size());
  for (std::size_t i = 0; i < indices.size(); ++i) {
    const std::size_t vertex = indices[i];
    const Vec3 y_up(positions[3 * vertex] + node[0], positions[3 * vertex + 1] + node[1],
                    positions[3 * vertex + 2] + node[2]);
    const Vec3& expected = mesh.mesh.vertices[mesh.mesh.triangles[i / 3][i % 3]];
    EXPECT_LT((Vec3(y_up.x(), -y_up.z(), y_up.y()) - expected).norm(), 1e-5);
    EXPECT_NEAR(uv[2 * vertex] / 65535.0, mesh.uv[vertex].x(), 1e-5);
    EXPECT_NEAR(uv[2 * vertex + 1] / 65535.0, mesh.uv[vertex].y(), 1e-5);
  }
}

TEST(GlbWriter, PositionBoundsAreExact) {
  const TexturedMesh mesh = random_mesh({0, 0, 0}, 50, nullptr, 2);
  const tinygltf::Model model = read(imaging::write_glb({mesh}, {}));
  const auto& accessor =
      model.accessors[static_cast<std::size_t>(model.meshes[0].primitives[0].attributes.at("POSITION"))];
  const auto positions = values<float>(model, model.meshes[0].primitives[0].attributes.at("POSITION"), 3);
  for (std::size_t axis = 0; axis < 3; ++axis) {
    float low = positions[axis], high = positions[axis];
    for (std::size_t i = axis; i < positions.size(); i += 3) {
      low = std::min(low, positions[i]);
      high = std::max(high, positions[i]);
    }
    EXPECT_EQ(static_cast<float>(accessor.minValues[axis]), low);
    EXPECT_EQ(static_cast<float>(accessor.maxValues[axis]), high);
  }
}

TEST(GlbWriter, SharesAnImageBetweenMeshesAndWritesItAsJpeg) {
  const auto texture = std::make_shared<imaging::RgbImage>(32, 32, imaging::Rgb8{20, 160, 90});
  const tinygltf::Model model =
      read(imaging::write_glb({random_mesh({0, 0, 0}, 3, texture, 3), random_mesh({9, 0, 0}, 3, texture, 4)}, {}));
  ASSERT_EQ(model.meshes[0].primitives.size(), 2U);
  ASSERT_EQ(model.images.size(), 1U);
  EXPECT_EQ(model.images[0].mimeType, "image/jpeg");
  const auto bytes = std::as_bytes(std::span(model.images[0].image));
  const imaging::RgbImage image = imaging::decode_rgb(bytes, "texture");
  ASSERT_EQ(image.width, 32);
  for (std::size_t c = 0; c < 3; ++c) EXPECT_NEAR(image(5, 5)[c], (*texture)(5, 5)[c], 3);
  EXPECT_EQ(model.materials.size(), 2U);
  EXPECT_TRUE(model.materials[0].extensions.contains("KHR_materials_unlit"));
}

TEST(GlbWriter, LargeMeshesGetWideIndices) {
  const tinygltf::Model model = read(imaging::write_glb({random_mesh({0, 0, 0}, 30000, nullptr, 5)}, {}));
  const auto indices = values<std::uint32_t>(model, model.meshes[0].primitives[0].indices, 1);
  EXPECT_EQ(*std::max_element(indices.begin(), indices.end()), 89999U);
}

TEST(GlbWriter, LengthsInTheContainerAreWhole) {
  const std::string glb = imaging::write_glb({random_mesh({0, 0, 0}, 7, nullptr, 6)}, {80, "x"});
  std::uint32_t total = 0, json = 0;
  std::memcpy(&total, glb.data() + 8, 4);
  std::memcpy(&json, glb.data() + 12, 4);
  EXPECT_EQ(total, glb.size());
  EXPECT_EQ(json % 4, 0U);
  EXPECT_EQ(glb.substr(20 + json + 4, 4), std::string("BIN\0", 4));
}

/// Corners with all that belongs to them, triangle by triangle, each from its smallest corner on.
std::vector<std::array<std::array<double, 6>, 3>> corners_of(const TexturedMesh& mesh) {
  std::vector<std::array<std::array<double, 6>, 3>> out;
  for (const geometry::Triangle& t : mesh.mesh.triangles) {
    std::array<std::array<double, 6>, 3> corners{};
    for (std::size_t k = 0; k < 3; ++k) {
      const Vec3& v = mesh.mesh.vertices[t[k]];
      corners[k] = {v.x(), v.y(), v.z(), 0, 0, 0};
      if (!mesh.uv.empty()) corners[k][3] = double{mesh.uv[t[k]].x()}, corners[k][4] = double{mesh.uv[t[k]].y()};
      if (!mesh.colors.empty()) corners[k][5] = 256.0 * mesh.colors[t[k]][0] + mesh.colors[t[k]][2];
    }
    std::rotate(corners.begin(), std::min_element(corners.begin(), corners.end()), corners.end());
    out.push_back(corners);
  }
  std::sort(out.begin(), out.end());
  return out;
}

TEST(WriteGlb, PackedGeometryIsReadBackTheSame) {
  const auto texture = std::make_shared<imaging::RgbImage>(8, 8, imaging::Rgb8{10, 200, 90});
  TexturedMesh textured = random_mesh({1000.25, -2000, 30}, 700, texture, 3),
               colored = random_mesh({0, 0, 0}, 30000, nullptr, 4);
  colored.uv.clear();
  for (std::size_t i = 0; i < colored.mesh.vertices.size(); ++i)
    colored.colors.push_back({static_cast<std::uint8_t>(i), 7, static_cast<std::uint8_t>(i / 256), 255});
  const auto decoded = [&](bool meshopt) {
    const std::string glb = imaging::write_glb({textured, colored}, {.meshopt = meshopt});
    return decode_content(std::as_bytes(std::span(glb)), "a.glb").meshes;
  };
  const std::vector<TexturedMesh> plain = decoded(false), packed = decoded(true);
  ASSERT_EQ(packed.size(), 2U);
  for (std::size_t i = 0; i < 2; ++i) {
    EXPECT_EQ(corners_of(packed[i]), corners_of(plain[i]));
    EXPECT_EQ(packed[i].base_color, plain[i].base_color);
  }
  EXPECT_TRUE(packed[0].texture->pixels == plain[0].texture->pixels);
}

}  // namespace
}  // namespace tileflight::tile_content::glb_writer_test
