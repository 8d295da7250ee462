#include <gtest/gtest.h>
#include <tiny_gltf.h>

#include <filesystem>

#include "tests/test_data.h"
#include "tileflight/core/base/files.h"
#include "tileflight/tiles/tile_content/content.h"

/// Oracle: another library reads the same files; all corners must be at the same positions.
namespace tileflight::tile_content::gltf_oracle_test {
namespace {

namespace fs = std::filesystem;
using geometry::Mat4;
using geometry::Vec3;

Mat4 matrix_of(const tinygltf::Node& node) {
  if (node.matrix.size() == 16) return Eigen::Map<const Mat4>(node.matrix.data());
  Eigen::Affine3d T = Eigen::Affine3d::Identity();
  if (node.translation.size() == 3) T.translate(Vec3(node.translation.data()));
  if (node.rotation.size() == 4) {
    T.rotate(Eigen::Quaterniond(node.rotation[3], node.rotation[0], node.rotation[1], node.rotation[2]));
  }
  if (node.scale.size() == 3) T.scale(Vec3(node.scale.data()));
  return T.matrix();
}

/// Corners of all triangles (mode 4, positions in floats), triangle after triangle, y up.
struct Corners {
  const tinygltf::Model& model;
  std::vector<Vec3> points = {};
  bool readable = true;

  const unsigned char* data(const tinygltf::Accessor& accessor) const {
    const tinygltf::BufferView& view = model.bufferViews[static_cast<std::size_t>(accessor.bufferView)];
    return model.buffers[static_cast<std::size_t>(view.buffer)].data.data() + view.byteOffset + accessor.byteOffset;
  }

  std::size_t index(const tinygltf::Accessor& accessor, std::size_t i) const {
    const unsigned char* at = data(accessor);
    if (accessor.componentType == TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE) return at[i];
    if (accessor.componentType == TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT)
      return reinterpret_cast<const std::uint16_t*>(at)[i];
    return reinterpret_cast<const std::uint32_t*>(at)[i];
  }

  void add(const tinygltf::Primitive& primitive, const Mat4& T) {
    const auto accessor = [&](int i) -> const tinygltf::Accessor& {
      return model.accessors[static_cast<std::size_t>(i)];
    };
    const tinygltf::Accessor& positions = accessor(primitive.attributes.at("POSITION"));
    if (primitive.mode != TINYGLTF_MODE_TRIANGLES || positions.componentType != TINYGLTF_COMPONENT_TYPE_FLOAT) {
      readable = false;
      return;
    }
    const auto stride = static_cast<std::size_t>(
        positions.ByteStride(model.bufferViews[static_cast<std::size_t>(positions.bufferView)]));
    const std::size_t count = primitive.indices < 0 ? positions.count : accessor(primitive.indices).count;
    for (std::size_t i = 0; i < count; ++i) {
      const std::size_t vertex = primitive.indices < 0 ? i : index(accessor(primitive.indices), i);
      const auto* p = reinterpret_cast<const float*>(data(positions) + vertex * stride);
      points.push_back((T * Eigen::Vector4d(p[0], p[1], p[2], 1)).head<3>());
    }
  }

  void add(int node_index, const Mat4& T_parent) {
    const tinygltf::Node& node = model.nodes[static_cast<std::size_t>(node_index)];
    const Mat4 T = T_parent * matrix_of(node);
    if (node.extensions.count("EXT_mesh_gpu_instancing") > 0) readable = false;
    if (node.mesh >= 0) {
      for (const auto& primitive : model.meshes[static_cast<std::size_t>(node.mesh)].primitives) add(primitive, T);
    }
    for (const int child : node.children) add(child, T);
  }
};

std::vector<Vec3> corners_of(const DecodedContent& content) {
  std::vector<Vec3> points;
  for (const imaging::TexturedMesh& mesh : content.meshes) {
    for (const geometry::Triangle& triangle : mesh.mesh.triangles) {
      for (const std::uint32_t corner : triangle) points.push_back(mesh.mesh.vertices[corner]);
    }
  }
  return points;
}

/// Whether both could be compared.
bool compare(const fs::path& file) {
  const std::vector<std::byte> bytes = base::read_bytes(file);
  tinygltf::TinyGLTF reader;
  // Images are not compared.
  reader.SetImageLoader([](tinygltf::Image*, int, std::string*, std::string*, int, int, const unsigned char*, int,
                           void*) { return true; },
                        nullptr);
  tinygltf::Model model;
  std::string error;
  std::string warning;
  const bool loaded =
      reader.LoadBinaryFromMemory(&model, &error, &warning, reinterpret_cast<const unsigned char*>(bytes.data()),
                                  static_cast<unsigned>(bytes.size()), file.parent_path());
  if (!loaded || model.scenes.empty() || !model.extensionsRequired.empty()) return false;
  Corners oracle{model};
  for (const int node : model.scenes[static_cast<std::size_t>(std::max(model.defaultScene, 0))].nodes) {
    oracle.add(node, Mat4::Identity());
  }
  if (!oracle.readable) return false;
  const std::vector<Vec3> ours =
      corners_of(decode_content(bytes, file.filename(), {.textures = false, .up_axis = UpAxis::kZ}));
  EXPECT_EQ(ours.size(), oracle.points.size()) << file;
  if (ours.size() != oracle.points.size()) return true;
  double worst = 0;
  for (std::size_t i = 0; i < ours.size(); ++i) {
    worst = std::max(worst, (ours[i] - oracle.points[i]).norm() / (1 + oracle.points[i].norm()));
  }
  EXPECT_LT(worst, 1e-9) << file;
  return true;
}

TEST(GltfOracle, SameCornersAsAnotherLibrary) {
  int compared = 0;
  for (const char* name : {"tilesets/cesium_3d_tiles_samples", "tilesets/cesiumjs_specs_data"}) {
    TILEFLIGHT_REQUIRE_TEST_DATA(folder, name);
    for (const fs::directory_entry& entry : fs::recursive_directory_iterator(folder)) {
      if (entry.path().extension() == ".glb" && compare(entry.path())) ++compared;
    }
  }
  EXPECT_GT(compared, 60);
}

}  // namespace
}  // namespace tileflight::tile_content::gltf_oracle_test
