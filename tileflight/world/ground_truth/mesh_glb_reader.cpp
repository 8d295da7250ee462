#include <algorithm>
#include <array>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <numeric>
#include <stdexcept>
#include <string>
#include <vector>

#include "tileflight/core/base/input_error.h"
#include "tileflight/core/imaging/glb_document.h"
#include "tileflight/world/ground_truth/mesh_glb.h"
#include "tileflight/world/ground_truth/mesh_glb_layout.h"

namespace tileflight::ground_truth {
namespace {

using geometry::Mat4;
using geometry::TriangleMesh;
using geometry::Vec3;
using nlohmann::json;

/// Returns a node's own transform.
Mat4 local_matrix(const json& node) {
  const auto numbers = [&](const char* key) { return node.value(key, std::vector<double>()); };
  if (const auto matrix = numbers("matrix"); matrix.size() == 16) return Eigen::Map<const Mat4>(matrix.data());
  Eigen::Affine3d T = Eigen::Affine3d::Identity();
  if (const auto t = numbers("translation"); t.size() == 3) T.translate(Eigen::Map<const Vec3>(t.data()));
  if (const auto r = numbers("rotation"); r.size() == 4) T.rotate(Eigen::Quaterniond(r[3], r[0], r[1], r[2]));
  if (const auto s = numbers("scale"); s.size() == 3) T.scale(Eigen::Map<const Vec3>(s.data()));
  return T.matrix();
}

/// Extracts the triangles of a glTF. Every index and range is checked; a malformed part throws InputError or
/// nlohmann::json::exception.
class GlbReader {
 public:
  GlbReader(const json& gltf, const std::vector<std::byte>& binary, std::string file)
      : gltf_(gltf), binary_(binary), file_(std::move(file)) {}

  NumberedMesh read() {
    for (const json& node : gltf_.at("scenes").at(gltf_.value("scene", std::size_t{0})).at("nodes"))
      add_node(node.get<std::size_t>(), T_gltf_local().inverse(), 0);
    if (mesh_.triangles.empty()) throw InputError(file_, "has no triangles");
    // Without origins the file is the whole.
    if (numbers_.size() < mesh_.triangles.size()) {
      numbers_.resize(mesh_.triangles.size());
      std::iota(numbers_.begin(), numbers_.end(), std::uint64_t{0});
    }
    return {std::move(mesh_), std::move(numbers_)};
  }

 private:
  void add_node(std::size_t index, const Mat4& T_local_parent, int depth) {
    if (depth > 64) throw InputError(file_, "its nodes are nested more than 64 deep or form a cycle");
    const json& node = gltf_.at("nodes").at(index);
    const Mat4 T_local_node = T_local_parent * local_matrix(node);
    for (const json& child : node.value("children", json::array()))
      add_node(child.get<std::size_t>(), T_local_node, depth + 1);
    if (!node.contains("mesh")) return;
    const json& mesh = gltf_.at("meshes").at(node.at("mesh").get<std::size_t>());
    for (const json& primitive : mesh.at("primitives")) add_primitive(primitive, T_local_node);
    const json extras = mesh.value("extras", json());
    if (extras.is_object() && extras.contains(kOriginKey)) add_numbers(extras.at(kOriginKey));
  }

  void add_numbers(const json& origin) {
    const auto number = [&](const char* key) {
      const auto value = origin.is_object() ? origin.find(key) : origin.end();
      if (value == origin.end() || !value->is_number_unsigned())
        throw InputError(file_, std::string("the origin of a mesh has no valid '") + key + "'");
      return value->get<std::uint64_t>();
    };
    const std::size_t count = mesh_.triangles.size() - std::min(mesh_.triangles.size(), numbers_.size());
    for (const std::uint32_t triangle : read_view<std::uint32_t>(number("view"), 0, count))
      numbers_.push_back(number("content") << 32 | (number("first") + triangle));
  }

  void add_primitive(const json& primitive, const Mat4& T_local_node) {
    const json& attributes = primitive.at("attributes");
    if (primitive.value("mode", 4) != 4 || !attributes.contains("POSITION") || !primitive.contains("indices"))
      throw InputError(file_, "contains something other than indexed triangles");
    const auto base = static_cast<std::uint32_t>(mesh_.vertices.size());
    const auto positions = read_accessor<Eigen::Vector3f>(attributes.at("POSITION"), imaging::kGltfFloat, "VEC3");
    for (const Eigen::Vector3f& p : positions) {
      mesh_.vertices.push_back((T_local_node * p.cast<double>().homogeneous()).head<3>());
      if (!mesh_.vertices.back().allFinite()) throw InputError(file_, "a position is not finite");
    }
    const auto corners = read_accessor<std::uint32_t>(primitive.at("indices"), imaging::kGltfUnsignedInt, "SCALAR");
    for (std::size_t i = 0; i + 2 < corners.size(); i += 3) {
      const geometry::Triangle t{corners[i], corners[i + 1], corners[i + 2]};
      for (const std::uint32_t corner : t) {
        if (corner >= positions.size()) throw InputError(file_, "a triangle refers to a vertex that does not exist");
      }
      mesh_.triangles.push_back({base + t[0], base + t[1], base + t[2]});
    }
  }

  template <typename T>
  std::vector<T> read_accessor(const json& index, int component_type, const char* type) const {
    const json& accessor = gltf_.at("accessors").at(index.get<std::size_t>());
    if (accessor.at("componentType") != component_type || accessor.at("type") != type)
      throw InputError(file_, "its positions or indices are not of the type that tileflight writes");
    return read_view<T>(accessor.at("bufferView").get<std::size_t>(), accessor.value("byteOffset", std::size_t{0}),
                        accessor.at("count").get<std::size_t>());
  }

  template <typename T>
  std::vector<T> read_view(std::size_t index, std::size_t offset, std::size_t count) const {
    const json& view = gltf_.at("bufferViews").at(index);
    const std::size_t begin = view.value("byteOffset", std::size_t{0}) + offset;
    const std::size_t stride = view.value("byteStride", sizeof(T));
    if (view.at("buffer") != 0) throw InputError(file_, "has more than one buffer");
    if (stride != 0 && stride != sizeof(T)) throw InputError(file_, "its accessors are interleaved");
    if (begin > binary_.size() || count > (binary_.size() - begin) / sizeof(T))
      throw InputError(file_, "an accessor reaches beyond the file: it is truncated or damaged");
    std::vector<T> values(count);
    if (!values.empty()) std::memcpy(static_cast<void*>(values.data()), binary_.data() + begin, count * sizeof(T));
    return values;
  }

  const json& gltf_;
  const std::vector<std::byte>& binary_;
  std::string file_;
  TriangleMesh mesh_;
  std::vector<std::uint64_t> numbers_;
};

/// A GLB file (glTF 2.0, section 4.4) that is read from its beginning.
class GlbFile {
 public:
  /// Throws InputError if the file is no GLB, or shorter than it states.
  explicit GlbFile(const std::filesystem::path& file) : name_(file.string()), stream_(file, std::ios::binary) {
    std::error_code fault;
    bytes_ = std::filesystem::file_size(file, fault);
    std::array<std::uint32_t, 3> head{};  // magic, version, bytes
    const bool is_read = !fault && read(head.data(), sizeof head);
    if (!is_read || head[0] != 0x46546C67U || head[1] != 2 || head[2] > bytes_)
      throw InputError(name_, "is not a readable GLB file");
  }

  /// Reads the JSON, which comes first.
  json read_json() {
    const std::vector<std::byte> text = read_chunk(0x4E4F534AU);
    json out = json::parse(reinterpret_cast<const char*>(text.data()),
                           reinterpret_cast<const char*>(text.data()) + text.size(), nullptr, false);
    if (!out.is_object()) throw InputError(name_, "is not a readable GLB file: its JSON is truncated or damaged");
    return out;
  }

  /// Reads the binary chunk after the JSON.
  std::vector<std::byte> read_binary() { return read_chunk(0x004E4942U); }

 private:
  bool read(void* to, std::size_t bytes) {
    return static_cast<bool>(stream_.read(static_cast<char*>(to), static_cast<std::streamsize>(bytes)));
  }

  std::vector<std::byte> read_chunk(std::uint32_t type) {
    std::array<std::uint32_t, 2> head{};  // bytes, type
    const bool is_chunk = read(head.data(), sizeof head) && head[1] == type && head[0] <= bytes_;
    std::vector<std::byte> out(is_chunk ? head[0] : 0);
    if (!is_chunk || !read(out.data(), out.size()))
      throw InputError(name_, "is not a readable GLB file: a chunk is truncated or missing");
    return out;
  }

  std::string name_;
  std::ifstream stream_;
  std::uintmax_t bytes_ = 0;
};

}  // namespace

TriangleMesh read_mesh_glb(const std::filesystem::path& file) { return read_numbered_mesh_glb(file).mesh; }

NumberedMesh read_numbered_mesh_glb(const std::filesystem::path& file) {
  GlbFile glb(file);
  const json gltf = glb.read_json();
  const std::vector<std::byte> binary = glb.read_binary();
  try {
    return GlbReader(gltf, binary, file.string()).read();
  } catch (const json::exception& error) {
    throw InputError(file.string(), std::string("is not a readable GLB file: ") + error.what());
  }
}

geometry::Box3 read_mesh_glb_bounds(const std::filesystem::path& file) {
  const json glb = GlbFile(file).read_json();
  geometry::Box3 box;
  try {
    // As write_mesh_glb() makes it: the root's rotation is undone, so that a mesh's node only moves it.
    for (const json& child : glb.at("nodes").at(0).at("children")) {
      const json& node = glb.at("nodes").at(child.get<std::size_t>());
      const std::vector<double> moved = node.at("translation");
      for (const json& primitive : glb.at("meshes").at(node.at("mesh").get<std::size_t>()).at("primitives")) {
        const json& positions = glb.at("accessors").at(primitive.at("attributes").at("POSITION").get<std::size_t>());
        for (const char* key : {"min", "max"}) {
          const std::vector<double> corner = positions.at(key);
          box.extend(
              Vec3(Vec3(corner.at(0), corner.at(1), corner.at(2)) + Vec3(moved.at(0), moved.at(1), moved.at(2))));
        }
      }
    }
  } catch (const json::exception&) {
    throw InputError(file.string(), "was not written by `tileflight extract`");
  } catch (const std::out_of_range&) {
    throw InputError(file.string(), "was not written by `tileflight extract`");
  }
  if (box.isEmpty() || !box.min().allFinite() || !box.max().allFinite())
    throw InputError(file.string(), "states no bounds of its triangles");
  return box;
}

}  // namespace tileflight::ground_truth
