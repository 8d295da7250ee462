#include "tileflight/core/imaging/glb_writer.h"

#include <meshoptimizer.h>

#include <array>
#include <cassert>
#include <string_view>
#include <utility>

#include "tileflight/core/imaging/glb_document.h"
#include "tileflight/core/imaging/image_files.h"

namespace tileflight::imaging {
namespace {

using geometry::Vec3;
using nlohmann::json;

/// Converts z up to y up: (x, y, z) becomes (x, z, -y).
Vec3 y_up(const Vec3& p) { return {p.x(), p.z(), -p.y()}; }

/// Appends the bytes of values, which the result keeps.
template <class T>
GlbDocument::Append owned(std::vector<T> values) {
  return [values = std::move(values)](std::size_t begin, std::size_t end, std::string& out) {
    out.append(reinterpret_cast<const char*>(values.data()) + begin, end - begin);
  };
}

/// Writes meshes as primitives of one node.
class GlbWriter {
 public:
  GlbWriter(const EncodedImages& images, const GlbOptions& options) : options_(options), document_(images, true) {
    if (!options.copyright.empty()) document_.json["asset"]["copyright"] = options.copyright;
    if (!options.meshopt) return;
    document_.json["extensionsUsed"].push_back("EXT_meshopt_compression");
    document_.json["extensionsRequired"] = {"EXT_meshopt_compression"};
  }

  void add_mesh(const TexturedMesh& mesh, const Vec3& node) {
    json primitive;
    primitive["attributes"]["POSITION"] = add_positions(mesh.mesh.vertices, node);
    if (!mesh.uv.empty()) primitive["attributes"]["TEXCOORD_0"] = add_uv(mesh.uv);
    if (!mesh.colors.empty())
      primitive["attributes"]["COLOR_0"] = document_.add_accessor(add_attributes(mesh.colors, mesh.colors.size()),
                                                                  kGltfUnsignedByte, "VEC4", mesh.colors.size(), true);
    primitive["indices"] = add_indices(mesh.mesh);
    primitive["material"] = document_.add_material(mesh);
    primitives_.push_back(std::move(primitive));
  }

  std::string finish(const Vec3& node) {
    document_.json["meshes"] = json::array({{{"primitives", primitives_}}});
    const Vec3 translation = y_up(node);
    document_.add("nodes", {{"mesh", 0}, {"translation", {translation.x(), translation.y(), translation.z()}}});
    const std::size_t bytes = document_.binary_bytes();
    document_.add("buffers", {{"byteLength", bytes + glb_padding(bytes)}});
    if (options_.meshopt)
      document_.add("buffers", {{"byteLength", unpacked_bytes_},
                                {"extensions", {{"EXT_meshopt_compression", {{"fallback", true}}}}}});
    std::string glb;
    GlbStream stream(document_);
    for (std::string_view piece = stream.next(); !piece.empty(); piece = stream.next()) glb += piece;
    return glb;
  }

 private:
  template <class T>
  std::size_t add_view(std::vector<T> values, int target) {
    const std::size_t bytes = values.size() * sizeof(T);
    return document_.add_view(bytes, owned(std::move(values)), target);
  }

  /// Adds vertex attributes of one type. Packed, the view has the place that its bytes would have in a second buffer,
  /// which is not there (EXT_meshopt_compression, "Fallback buffers").
  template <class T>
  std::size_t add_attributes(std::vector<T> values, std::size_t count) {
    const std::size_t stride = values.size() * sizeof(T) / count;
    if (!options_.meshopt) return add_view(std::move(values), kGltfArrayBuffer);
    std::vector<unsigned char> packed(meshopt_encodeVertexBufferBound(count, stride));
    packed.resize(meshopt_encodeVertexBuffer(packed.data(), packed.size(), values.data(), count, stride));
    return add_packed(std::move(packed), count, stride, "ATTRIBUTES", kGltfArrayBuffer);
  }

  std::size_t add_packed(std::vector<unsigned char> packed, std::size_t count, std::size_t stride, const char* mode,
                         int target) {
    const std::size_t bytes = packed.size(), offset = document_.add_part(bytes, owned(std::move(packed)));
    json view{{"buffer", 1}, {"byteOffset", unpacked_bytes_}, {"byteLength", count * stride}, {"target", target}};
    if (target == kGltfArrayBuffer) view["byteStride"] = stride;
    view["extensions"]["EXT_meshopt_compression"] = {{"buffer", 0},    {"byteOffset", offset},
                                                     {"count", count}, {"byteLength", bytes},
                                                     {"mode", mode},   {"byteStride", stride}};
    unpacked_bytes_ += (count * stride + 3) / 4 * 4;
    return document_.add("bufferViews", std::move(view));
  }

  std::size_t add_positions(const std::vector<Vec3>& vertices, const Vec3& node) {
    std::vector<float> values;
    std::array<float, 3> low{}, high{};
    for (const Vec3& vertex : vertices) {
      const Vec3 p = y_up(vertex - node);
      for (std::size_t axis = 0; axis < 3; ++axis) {
        const auto value = static_cast<float>(p[static_cast<Eigen::Index>(axis)]);
        const bool first = values.size() < 3;
        low[axis] = first ? value : std::min(low[axis], value);
        high[axis] = first ? value : std::max(high[axis], value);
        values.push_back(value);
      }
    }
    const std::size_t accessor =
        document_.add_accessor(add_attributes(std::move(values), vertices.size()), kGltfFloat, "VEC3", vertices.size());
    document_.json["accessors"][accessor].update({{"min", low}, {"max", high}});
    return accessor;
  }

  std::size_t add_uv(const std::vector<Eigen::Vector2f>& uv) {
    std::vector<std::uint16_t> values;
    for (const Eigen::Vector2f& at : uv) {
      assert(at.minCoeff() >= 0.0F && at.maxCoeff() <= 1.0F);
      values.push_back(static_cast<std::uint16_t>(at.x() * 65535.0F + 0.5F));
      values.push_back(static_cast<std::uint16_t>(at.y() * 65535.0F + 0.5F));
    }
    return document_.add_accessor(add_attributes(std::move(values), uv.size()), kGltfUnsignedShort, "VEC2", uv.size(),
                                  true);
  }

  std::size_t add_indices(const geometry::TriangleMesh& mesh) {
    const bool is_short = mesh.vertices.size() < 65535;
    std::vector<unsigned int> corners;
    for (const geometry::Triangle& t : mesh.triangles) corners.insert(corners.end(), t.begin(), t.end());
    const std::size_t count = corners.size();
    const std::size_t view =
        options_.meshopt ? add_packed_indices(corners, mesh.vertices.size(), is_short)
        : is_short       ? add_view(std::vector<std::uint16_t>(corners.begin(), corners.end()), kGltfElementArrayBuffer)
                         : add_view(std::move(corners), kGltfElementArrayBuffer);
    return document_.add_accessor(view, is_short ? kGltfUnsignedShort : kGltfUnsignedInt, "SCALAR", count);
  }

  std::size_t add_packed_indices(const std::vector<unsigned int>& corners, std::size_t vertices, bool is_short) {
    std::vector<unsigned char> packed(meshopt_encodeIndexBufferBound(corners.size(), vertices));
    packed.resize(meshopt_encodeIndexBuffer(packed.data(), packed.size(), corners.data(), corners.size()));
    return add_packed(std::move(packed), corners.size(), is_short ? 2 : 4, "TRIANGLES", kGltfElementArrayBuffer);
  }

  const GlbOptions& options_;
  GlbDocument document_;
  json primitives_ = json::array();
  std::size_t unpacked_bytes_ = 0;  ///< size of the second buffer, which packed views would fill
};

Vec3 node_of(const std::vector<TexturedMesh>& meshes) {
  geometry::Box3 box;
  for (const TexturedMesh& mesh : meshes)
    for (const Vec3& vertex : mesh.mesh.vertices) box.extend(vertex);
  return box.isEmpty() ? Vec3(Vec3::Zero()) : Vec3(box.center().array().round());
}

/// Triangles in an order that reuses vertices, and vertices in the order in which triangles use them: both pack well.
TexturedMesh ordered_for_packing(const TexturedMesh& mesh) {
  std::vector<unsigned int> corners;
  for (const geometry::Triangle& t : mesh.mesh.triangles) corners.insert(corners.end(), t.begin(), t.end());
  const std::size_t vertices = mesh.mesh.vertices.size();
  meshopt_optimizeVertexCache(corners.data(), corners.data(), corners.size(), vertices);
  std::vector<unsigned int> place_of(vertices);
  const std::size_t used = meshopt_optimizeVertexFetchRemap(place_of.data(), corners.data(), corners.size(), vertices);
  TexturedMesh out = mesh;
  const auto reorder = [&](const auto& from, auto& to) {
    to.resize(std::min(from.size(), used));
    for (std::size_t i = 0; i < from.size(); ++i)
      if (place_of[i] < used) to[place_of[i]] = from[i];
  };
  reorder(mesh.mesh.vertices, out.mesh.vertices);
  reorder(mesh.uv, out.uv);
  reorder(mesh.colors, out.colors);
  for (std::size_t i = 0; i < corners.size(); ++i) out.mesh.triangles[i / 3][i % 3] = place_of[corners[i]];
  return out;
}

}  // namespace

std::string write_glb(const std::vector<TexturedMesh>& meshes, const GlbOptions& options) {
  EncodedImages images;
  for (const TexturedMesh& mesh : meshes)
    if (mesh.texture && !mesh.mesh.triangles.empty() && !images.contains(mesh.texture.get()))
      images[mesh.texture.get()] = encode_jpeg(*mesh.texture, options.jpeg_quality);
  GlbWriter writer(images, options);
  const Vec3 node = node_of(meshes);
  for (const TexturedMesh& mesh : meshes) {
    assert(mesh.colors.empty() || mesh.colors.size() == mesh.mesh.vertices.size());
    if (mesh.mesh.triangles.empty()) continue;
    writer.add_mesh(options.meshopt ? ordered_for_packing(mesh) : mesh, node);
  }
  return writer.finish(node);
}

}  // namespace tileflight::imaging
