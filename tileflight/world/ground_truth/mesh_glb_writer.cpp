#include <tbb/parallel_for.h>

#include <mutex>
#include <nlohmann/json.hpp>
#include <span>
#include <string>

#include "tileflight/core/base/files.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/imaging/glb_document.h"
#include "tileflight/core/imaging/image_files.h"
#include "tileflight/world/ground_truth/mesh_glb.h"
#include "tileflight/world/ground_truth/mesh_glb_layout.h"

namespace tileflight::ground_truth {
namespace {

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

}  // namespace tileflight::ground_truth
