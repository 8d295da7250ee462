#include <tiny_gltf.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <fstream>
#include <nlohmann/json.hpp>
#include <numeric>
#include <stdexcept>
#include <string>

#include "tileflight/core/base/files.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/world/ground_truth/mesh_glb.h"

namespace tileflight::ground_truth {
namespace {

using geometry::Mat4;
using geometry::TriangleMesh;
using geometry::Vec3;

/// A node's own transform.
Mat4 local_matrix(const tinygltf::Node& node) {
  if (node.matrix.size() == 16) return Eigen::Map<const Mat4>(node.matrix.data());
  Eigen::Affine3d T = Eigen::Affine3d::Identity();
  if (node.translation.size() == 3) T.translate(Eigen::Map<const Vec3>(node.translation.data()));
  if (node.rotation.size() == 4) {
    T.rotate(Eigen::Quaterniond(node.rotation[3], node.rotation[0], node.rotation[1], node.rotation[2]));
  }
  if (node.scale.size() == 3) T.scale(Eigen::Map<const Vec3>(node.scale.data()));
  return T.matrix();
}

/// Extracts the triangles of a glTF model. Every index and range is checked.
class GlbReader {
 public:
  GlbReader(const tinygltf::Model& model, std::string file) : model_(model), file_(std::move(file)) {}

  NumberedMesh read() {
    if (model_.scenes.empty()) throw InputError(file_, "has no scene");
    const auto scene = static_cast<std::size_t>(std::max(model_.defaultScene, 0));
    for (const int node : at(model_.scenes, scene, "scene").nodes) add_node(node, T_gltf_local().inverse(), 0);
    if (mesh_.triangles.empty()) throw InputError(file_, "has no triangles");
    // Without origins the file is the whole.
    if (numbers_.size() < mesh_.triangles.size()) {
      numbers_.resize(mesh_.triangles.size());
      std::iota(numbers_.begin(), numbers_.end(), std::uint64_t{0});
    }
    return {std::move(mesh_), std::move(numbers_)};
  }

 private:
  template <typename T>
  const T& at(const std::vector<T>& values, std::size_t index, const std::string& what) const {
    if (index >= values.size()) throw InputError(file_, "refers to a " + what + " that does not exist");
    return values[index];
  }

  void add_node(int index, const Mat4& T_local_parent, int depth) {
    if (depth > 64) throw InputError(file_, "its nodes are nested more than 64 deep or form a cycle");
    const tinygltf::Node& node = at(model_.nodes, static_cast<std::size_t>(index), "node");
    const Mat4 T_local_node = T_local_parent * local_matrix(node);
    for (const int child : node.children) add_node(child, T_local_node, depth + 1);
    if (node.mesh < 0) return;
    const tinygltf::Mesh& mesh = at(model_.meshes, static_cast<std::size_t>(node.mesh), "mesh");
    for (const auto& primitive : mesh.primitives) add_primitive(primitive, T_local_node);
    if (mesh.extras.IsObject() && mesh.extras.Has(kOriginKey)) add_numbers(mesh.extras.Get(kOriginKey));
  }

  void add_numbers(const tinygltf::Value& origin) {
    const auto number = [&](const char* key) {
      const int value =
          origin.IsObject() && origin.Has(key) && origin.Get(key).IsInt() ? origin.Get(key).Get<int>() : -1;
      if (value < 0) throw InputError(file_, std::string("the origin of a mesh has no valid '") + key + "'");
      return static_cast<std::uint64_t>(value);
    };
    const std::size_t count = mesh_.triangles.size() - std::min(mesh_.triangles.size(), numbers_.size());
    for (const std::uint32_t triangle : read_view<std::uint32_t>(number("view"), 0, count))
      numbers_.push_back(number("content") << 32 | (number("first") + triangle));
  }

  void add_primitive(const tinygltf::Primitive& primitive, const Mat4& T_local_node) {
    const auto position = primitive.attributes.find("POSITION");
    if (primitive.mode != TINYGLTF_MODE_TRIANGLES || position == primitive.attributes.end() || primitive.indices < 0) {
      throw InputError(file_, "contains something other than indexed triangles");
    }
    const auto base = static_cast<std::uint32_t>(mesh_.vertices.size());
    const auto positions =
        read_accessor<Eigen::Vector3f>(position->second, TINYGLTF_COMPONENT_TYPE_FLOAT, TINYGLTF_TYPE_VEC3);
    for (const Eigen::Vector3f& p : positions) {
      mesh_.vertices.push_back((T_local_node * p.cast<double>().homogeneous()).head<3>());
      if (!mesh_.vertices.back().allFinite()) throw InputError(file_, "a position is not finite");
    }
    const auto corners =
        read_accessor<std::uint32_t>(primitive.indices, TINYGLTF_COMPONENT_TYPE_UNSIGNED_INT, TINYGLTF_TYPE_SCALAR);
    for (std::size_t i = 0; i + 2 < corners.size(); i += 3) {
      const geometry::Triangle t{corners[i], corners[i + 1], corners[i + 2]};
      for (const std::uint32_t corner : t) {
        if (corner >= positions.size()) throw InputError(file_, "a triangle refers to a vertex that does not exist");
      }
      mesh_.triangles.push_back({base + t[0], base + t[1], base + t[2]});
    }
  }

  template <typename T>
  std::vector<T> read_accessor(int index, int component_type, int type) const {
    const tinygltf::Accessor& accessor = at(model_.accessors, static_cast<std::size_t>(index), "accessor");
    if (accessor.componentType != component_type || accessor.type != type) {
      throw InputError(file_, "its positions or indices are not of the type that tileflight writes");
    }
    return read_view<T>(static_cast<std::size_t>(accessor.bufferView), accessor.byteOffset, accessor.count);
  }

  template <typename T>
  std::vector<T> read_view(std::size_t index, std::size_t offset, std::size_t count) const {
    const auto& view = at(model_.bufferViews, index, "buffer view");
    const auto& data = at(model_.buffers, static_cast<std::size_t>(view.buffer), "buffer").data;
    const std::size_t begin = view.byteOffset + offset;
    if (view.byteStride != 0 && view.byteStride != sizeof(T)) throw InputError(file_, "its accessors are interleaved");
    if (begin > data.size() || count > (data.size() - begin) / sizeof(T)) {
      throw InputError(file_, "an accessor reaches beyond the file: it is truncated or damaged");
    }
    std::vector<T> values(count);
    if (!values.empty()) std::memcpy(static_cast<void*>(values.data()), data.data() + begin, values.size() * sizeof(T));
    return values;
  }

  const tinygltf::Model& model_;
  std::string file_;
  TriangleMesh mesh_;
  std::vector<std::uint64_t> numbers_;
};

/// The JSON of a GLB file. Throws InputError.
nlohmann::json read_glb_json(const std::filesystem::path& file) {
  std::ifstream stream(file, std::ios::binary);
  std::array<std::uint32_t, 5> head{};  // magic, version, bytes, bytes of the JSON, its type
  stream.read(reinterpret_cast<char*>(head.data()), sizeof head);
  std::error_code fault;
  const std::uintmax_t bytes = std::filesystem::file_size(file, fault);
  const bool is_glb = stream && !fault && head[0] == 0x46546C67U && head[4] == 0x4E4F534AU;
  if (!is_glb || head[3] > bytes) throw InputError(file.string(), "is not a readable GLB file");
  std::string text(head[3], '\0');
  stream.read(text.data(), static_cast<std::streamsize>(text.size()));
  nlohmann::json json = stream ? nlohmann::json::parse(text, nullptr, false) : nlohmann::json();
  if (!json.is_object())
    throw InputError(file.string(), "is not a readable GLB file: its JSON is truncated or damaged");
  return json;
}

/// Prevents tinygltf from decoding the textures, which are not needed.
bool leave_image(tinygltf::Image*, int, std::string*, std::string*, int, int, const unsigned char*, int, void*) {
  return true;
}

/// The first line of tinygltf's message.
std::string one_line(const std::string& text) { return text.substr(0, text.find('\n')); }

}  // namespace

TriangleMesh read_mesh_glb(const std::filesystem::path& file) { return read_numbered_mesh_glb(file).mesh; }

NumberedMesh read_numbered_mesh_glb(const std::filesystem::path& file) {
  const std::string bytes = base::read_text(file);
  if (bytes.size() > 0xffffffffU) throw InputError(file.string(), "is larger than the 4 GiB of a GLB file");
  tinygltf::TinyGLTF loader;
  loader.SetImageLoader(leave_image, nullptr);
  tinygltf::Model model;
  std::string error, warning;
  const bool loaded =
      loader.LoadBinaryFromMemory(&model, &error, &warning, reinterpret_cast<const unsigned char*>(bytes.data()),
                                  static_cast<unsigned int>(bytes.size()));
  if (!loaded) throw InputError(file.string(), "is not a readable GLB file: " + one_line(error));
  return GlbReader(model, file.string()).read();
}

geometry::Box3 read_mesh_glb_bounds(const std::filesystem::path& file) {
  const nlohmann::json glb = read_glb_json(file);
  geometry::Box3 box;
  try {
    // As write_mesh_glb() makes it: the root's rotation is undone, so that a mesh's node only moves it.
    for (const nlohmann::json& child : glb.at("nodes").at(0).at("children")) {
      const nlohmann::json& node = glb.at("nodes").at(child.get<std::size_t>());
      const std::vector<double> moved = node.at("translation");
      for (const nlohmann::json& primitive : glb.at("meshes").at(node.at("mesh").get<std::size_t>()).at("primitives")) {
        const nlohmann::json& positions =
            glb.at("accessors").at(primitive.at("attributes").at("POSITION").get<std::size_t>());
        for (const char* key : {"min", "max"}) {
          const std::vector<double> corner = positions.at(key);
          box.extend(
              Vec3(Vec3(corner.at(0), corner.at(1), corner.at(2)) + Vec3(moved.at(0), moved.at(1), moved.at(2))));
        }
      }
    }
  } catch (const nlohmann::json::exception&) {
    throw InputError(file.string(), "was not written by `tileflight extract`");
  } catch (const std::out_of_range&) {
    throw InputError(file.string(), "was not written by `tileflight extract`");
  }
  if (box.isEmpty() || !box.min().allFinite() || !box.max().allFinite())
    throw InputError(file.string(), "states no bounds of its triangles");
  return box;
}

}  // namespace tileflight::ground_truth
