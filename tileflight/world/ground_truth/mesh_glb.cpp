#include "tileflight/world/ground_truth/mesh_glb.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <mutex>
#include <nlohmann/json.hpp>
#include <numeric>
#include <span>
#include <stdexcept>
#include <string>
#include <vector>

#include "tileflight/core/base/files.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/geometry/transform.h"
#include "tileflight/core/imaging/glb_document.h"
#include "tileflight/core/imaging/image_files.h"

namespace tileflight::ground_truth {
namespace {

/// Key of a mesh's `extras` that stores its MeshOrigin: {content, first, view: buffer view of `triangles`}.
constexpr const char* kOriginKey = "tileflight_origin";

/// z-up to y-up: (x, y, z) becomes (x, z, -y).
geometry::Mat4 T_gltf_local() {
  geometry::Mat4 m = geometry::Mat4::Identity();
  m.row(1) = Eigen::RowVector4d(0, 0, 1, 0);
  m.row(2) = Eigen::RowVector4d(0, -1, 0, 0);
  return m;
}

using geometry::Mat4;
using geometry::TriangleMesh;
using geometry::Vec3;
using imaging::EncodedImages;
using imaging::GlbDocument;
using imaging::TexturedMesh;
using nlohmann::json;

constexpr int kJpegQuality = 90;

/// Encodes every texture once, as JPEG; in parallel, since this takes longest.
EncodedImages encode_textures(const std::vector<TexturedMesh>& meshes, const Progress& progress) {
  EncodedImages encoded;
  for (const TexturedMesh& m : meshes) {
    if (m.texture && !m.texture->empty() && !m.uv.empty()) encoded[m.texture.get()];
  }
  std::vector<EncodedImages::value_type*> entries;
  for (auto& entry : encoded) entries.push_back(&entry);
  std::mutex progress_mutex;
  std::int64_t done = 0;
  tbb::parallel_for(std::size_t{0}, entries.size(), [&](std::size_t i) {
    entries[i]->second = imaging::encode_jpeg(*entries[i]->first, kJpegQuality);
    const std::lock_guard lock(progress_mutex);
    report_progress(progress, ++done, static_cast<std::int64_t>(entries.size()), "textures");
  });
  return encoded;
}

/// The limit of a GLB file, with room for its JSON.
constexpr std::size_t kMostBinary_bytes = 0xf0000000U;

/// Collects meshes into a binary glTF, whose bytes are not held but referred to: the meshes must outlive it.
class MeshGlb {
 public:
  explicit MeshGlb(const EncodedImages& images) : document_(images, false) {
    const Mat4 turn = T_gltf_local();
    document_.add("nodes", {{"name", "local frame: x east, y north, z up"},
                            {"matrix", std::vector(turn.data(), turn.data() + 16)}});  // column-major, as in glTF
  }

  void add(const TexturedMesh& m, const Vec3& center, const MeshOrigin* origin) {
    if (m.mesh.triangles.empty()) return;
    json primitive{{"mode", 4}};
    json& attributes = primitive["attributes"];
    attributes["POSITION"] = add_positions(m.mesh, center);
    if (!m.uv.empty()) attributes["TEXCOORD_0"] = add_accessor(std::span(m.uv), imaging::kGltfFloat, "VEC2");
    if (!m.colors.empty())
      attributes["COLOR_0"] = add_accessor(std::span(m.colors), imaging::kGltfUnsignedByte, "VEC4", true);
    const std::span corners(m.mesh.triangles.front().data(), 3 * m.mesh.triangles.size());
    const std::size_t view = add_view(corners, imaging::kGltfElementArrayBuffer);
    primitive["indices"] = document_.add_accessor(view, imaging::kGltfUnsignedInt, "SCALAR", corners.size());
    primitive["material"] = document_.add_material(m);
    json mesh{{"primitives", json::array({primitive})}};
    if (origin != nullptr)
      mesh["extras"][kOriginKey] = {{"content", static_cast<int>(origin->content)},
                                    {"first", static_cast<int>(origin->first)},
                                    {"view", add_view(std::span(origin->triangles), 0)}};
    json node{{"translation", {center.x(), center.y(), center.z()}}};
    if (!m.name.empty()) mesh["name"] = node["name"] = m.name;
    node["mesh"] = document_.add("meshes", std::move(mesh));
    document_.json["nodes"][0]["children"].push_back(document_.json["nodes"].size());
    document_.add("nodes", std::move(node));
  }

  /// Returns the finished document.
  const GlbDocument& finish() {
    document_.add("buffers", {{"byteLength", document_.binary_bytes()}});
    return document_;
  }

  std::size_t buffer_bytes() const { return document_.binary_bytes(); }

 private:
  template <typename T>
  std::size_t add_view(std::span<const T> values, int target) {
    const auto append = [values](std::size_t begin, std::size_t end, std::string& out) {
      out.append(reinterpret_cast<const char*>(values.data()) + begin, end - begin);
    };
    return document_.add_view(values.size_bytes(), append, target);
  }

  template <typename T>
  std::size_t add_accessor(std::span<const T> values, int component_type, const char* type, bool normalized = false) {
    return document_.add_accessor(add_view(values, imaging::kGltfArrayBuffer), component_type, type, values.size(),
                                  normalized);
  }

  /// Vertices become floats relative to the centre when they are written.
  std::size_t add_positions(const TriangleMesh& mesh, const Vec3& center) {
    Eigen::AlignedBox3f box;
    for (const Vec3& v : mesh.vertices) box.extend((v - center).cast<float>());
    const auto append = [&vertices = mesh.vertices, center](std::size_t begin, std::size_t end, std::string& out) {
      for (std::size_t at = begin; at < end; at += sizeof(Eigen::Vector3f)) {
        const Eigen::Vector3f p = (vertices[at / sizeof(Eigen::Vector3f)] - center).cast<float>();
        out.append(reinterpret_cast<const char*>(p.data()), sizeof p);
      }
    };
    const std::size_t count = mesh.vertices.size();
    const std::size_t view = document_.add_view(count * sizeof(Eigen::Vector3f), append, imaging::kGltfArrayBuffer);
    const std::size_t accessor = document_.add_accessor(view, imaging::kGltfFloat, "VEC3", count);
    document_.json["accessors"][accessor].update({{"min", {box.min().x(), box.min().y(), box.min().z()}},
                                                  {"max", {box.max().x(), box.max().y(), box.max().z()}}});
    return accessor;
  }

  GlbDocument document_;
};

/// Throws InputError if the triangles alone are too large for a GLB file: known before the textures are compressed.
void require_fitting(const std::string& file, std::size_t bytes) {
  if (bytes <= kMostBinary_bytes) return;
  throw InputError(
      file,
      "would be larger than the 4 GiB of a GLB file: choose blocks (--block), a smaller region or a larger "
      "geometric error");
}

std::size_t geometry_bytes(const std::vector<TexturedMesh>& meshes) {
  std::size_t bytes = 0;
  for (const TexturedMesh& m : meshes) {
    bytes += m.mesh.vertices.size() * sizeof(Eigen::Vector3f) + m.mesh.triangles.size() * sizeof(geometry::Triangle) +
             m.uv.size() * sizeof(Eigen::Vector2f) + m.colors.size() * sizeof(std::uint32_t);
  }
  return bytes;
}

}  // namespace

void write_mesh_glb(const std::filesystem::path& file, const std::vector<TexturedMesh>& meshes, bool textures,
                    const Progress& progress, const std::vector<Vec3>& centers,
                    const std::vector<MeshOrigin>& origins) {
  require_fitting(file.string(), geometry_bytes(meshes));
  const EncodedImages images = textures ? encode_textures(meshes, progress) : EncodedImages();
  MeshGlb glb(images);
  for (std::size_t i = 0; i < meshes.size(); ++i) {
    glb.add(meshes[i], centers.empty() ? Vec3(geometry::bounds(meshes[i].mesh).center()) : centers[i],
            origins.empty() ? nullptr : &origins[i]);
  }
  require_fitting(file.string(), glb.buffer_bytes());
  imaging::GlbStream stream(glb.finish());
  base::write_file_in_parts(file, [&] { return stream.next(); });
}

namespace {

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
    // write_mesh_glb() undoes the root's rotation, so that a mesh's node only moves it.
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
