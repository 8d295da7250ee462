#include "tileflight/tiles/tile_writer/glb_writer.h"

#include <meshoptimizer.h>

#include <array>
#include <cassert>
#include <cstring>
#include <map>
#include <nlohmann/json.hpp>

#include "tileflight/core/imaging/image_files.h"

namespace tileflight::tile_writer {
namespace {

using geometry::Vec3;
using imaging::TexturedMesh;
using nlohmann::json;

// glTF 2.0, section 5: numbers of component types, buffer targets, filters, wraps.
enum : int {
  kUnsignedByte = 5121,
  kUnsignedShort = 5123,
  kUnsignedInt = 5125,
  kFloat = 5126,
  kArrayBuffer = 34962,
  kElementArrayBuffer = 34963,
  kLinear = 9729,
  kLinearMipmapLinear = 9987,
  kClampToEdge = 33071,
  kMirroredRepeat = 33648,
  kRepeat = 10497
};

/// Converts z up to y up: (x, y, z) becomes (x, z, -y).
Vec3 y_up(const Vec3& p) { return {p.x(), p.z(), -p.y()}; }

/// The document under construction: JSON and its binary chunk.
class Document {
 public:
  explicit Document(const GlbOptions& options) : options_(options) {
    json_["asset"] = {{"version", "2.0"}, {"generator", "tileflight"}};
    if (!options.copyright.empty()) json_["asset"]["copyright"] = options.copyright;
    json_["extensionsUsed"] = {"KHR_materials_unlit"};
    if (!options.meshopt) return;
    json_["extensionsUsed"].push_back("EXT_meshopt_compression");
    json_["extensionsRequired"] = {"EXT_meshopt_compression"};
  }

  void add_mesh(const TexturedMesh& mesh, const Vec3& node) {
    json primitive;
    primitive["attributes"]["POSITION"] = add_positions(mesh.mesh.vertices, node);
    if (!mesh.uv.empty()) primitive["attributes"]["TEXCOORD_0"] = add_uv(mesh.uv);
    if (!mesh.colors.empty()) primitive["attributes"]["COLOR_0"] = add_colors(mesh.colors);
    primitive["indices"] = add_indices(mesh.mesh);
    primitive["material"] = add_material(mesh);
    primitives_.push_back(std::move(primitive));
  }

  /// Container of glTF 2.0, section 4: header, JSON chunk padded with blanks, binary chunk padded with zeros.
  std::string finish(const Vec3& node) {
    json_["meshes"] = json::array({{{"primitives", primitives_}}});
    const Vec3 translation = y_up(node);
    json_["nodes"] = json::array({{{"mesh", 0}, {"translation", {translation.x(), translation.y(), translation.z()}}}});
    json_["scenes"] = json::array({{{"nodes", {0}}}});
    json_["scene"] = 0;
    pad(binary_, '\0');
    json_["buffers"] = json::array({{{"byteLength", binary_.size()}}});
    if (options_.meshopt)
      json_["buffers"].push_back(
          {{"byteLength", unpacked_bytes_}, {"extensions", {{"EXT_meshopt_compression", {{"fallback", true}}}}}});
    std::string text = json_.dump();
    pad(text, ' ');
    std::string glb("glTF");
    append_u32(glb, 2);
    append_u32(glb, static_cast<std::uint32_t>(12 + 8 + text.size() + 8 + binary_.size()));
    append_u32(glb, static_cast<std::uint32_t>(text.size()));
    glb += "JSON" + text;
    append_u32(glb, static_cast<std::uint32_t>(binary_.size()));
    return glb.append("BIN\0", 4) + binary_;
  }

 private:
  static void pad(std::string& bytes, char with) { bytes.resize((bytes.size() + 3) / 4 * 4, with); }

  static void append_u32(std::string& bytes, std::uint32_t value) {
    for (unsigned shift = 0; shift < 32; shift += 8) bytes.push_back(static_cast<char>(value >> shift & 0xffU));
  }

  template <class T>
  std::size_t add_view(const std::vector<T>& values, int target) {
    pad(binary_, '\0');
    const std::size_t offset = binary_.size(), bytes = values.size() * sizeof(T);
    binary_.resize(offset + bytes);
    std::memcpy(binary_.data() + offset, values.data(), bytes);
    json view{{"buffer", 0}, {"byteOffset", offset}, {"byteLength", bytes}};
    if (target != 0) view["target"] = target;
    return add("bufferViews", std::move(view));
  }

  /// Vertex attributes of one type. Packed, the view has the place that its bytes would have in a second buffer, which
  /// is not there (EXT_meshopt_compression, "Fallback buffers").
  template <class T>
  std::size_t add_attributes(const std::vector<T>& values, std::size_t count) {
    const std::size_t stride = values.size() * sizeof(T) / count;
    if (!options_.meshopt) return add_view(values, kArrayBuffer);
    std::vector<unsigned char> packed(meshopt_encodeVertexBufferBound(count, stride));
    packed.resize(meshopt_encodeVertexBuffer(packed.data(), packed.size(), values.data(), count, stride));
    return add_packed(packed, count, stride, "ATTRIBUTES", kArrayBuffer);
  }

  std::size_t add_packed(const std::vector<unsigned char>& packed, std::size_t count, std::size_t stride,
                         const char* mode, int target) {
    pad(binary_, '\0');
    const std::size_t offset = binary_.size();
    binary_.append(reinterpret_cast<const char*>(packed.data()), packed.size());
    json view{{"buffer", 1}, {"byteOffset", unpacked_bytes_}, {"byteLength", count * stride}, {"target", target}};
    if (target == kArrayBuffer) view["byteStride"] = stride;
    view["extensions"]["EXT_meshopt_compression"] = {{"buffer", 0},    {"byteOffset", offset},
                                                     {"count", count}, {"byteLength", packed.size()},
                                                     {"mode", mode},   {"byteStride", stride}};
    unpacked_bytes_ += (count * stride + 3) / 4 * 4;
    return add("bufferViews", std::move(view));
  }

  std::size_t add(const char* list, json item) {
    json& array = json_[list];
    array.push_back(std::move(item));
    return array.size() - 1;
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
    return add("accessors", {{"bufferView", add_attributes(values, vertices.size())},
                             {"componentType", kFloat},
                             {"type", "VEC3"},
                             {"count", vertices.size()},
                             {"min", low},
                             {"max", high}});
  }

  std::size_t add_uv(const std::vector<Eigen::Vector2f>& uv) {
    std::vector<std::uint16_t> values;
    for (const Eigen::Vector2f& at : uv) {
      assert(at.minCoeff() >= 0.0F && at.maxCoeff() <= 1.0F);
      values.push_back(static_cast<std::uint16_t>(at.x() * 65535.0F + 0.5F));
      values.push_back(static_cast<std::uint16_t>(at.y() * 65535.0F + 0.5F));
    }
    return add("accessors", {{"bufferView", add_attributes(values, uv.size())},
                             {"componentType", kUnsignedShort},
                             {"normalized", true},
                             {"type", "VEC2"},
                             {"count", uv.size()}});
  }

  std::size_t add_colors(const std::vector<std::array<std::uint8_t, 4>>& colors) {
    return add("accessors", {{"bufferView", add_attributes(colors, colors.size())},
                             {"componentType", kUnsignedByte},
                             {"normalized", true},
                             {"type", "VEC4"},
                             {"count", colors.size()}});
  }

  std::size_t add_indices(const geometry::TriangleMesh& mesh) {
    const bool is_short = mesh.vertices.size() < 65535;
    std::vector<std::uint16_t> shorts;
    std::vector<std::uint32_t> longs;
    for (const geometry::Triangle& t : mesh.triangles)
      for (const std::uint32_t corner : t)
        is_short ? shorts.push_back(static_cast<std::uint16_t>(corner)) : longs.push_back(corner);
    const std::size_t view = options_.meshopt ? add_packed_indices(mesh, is_short)
                             : is_short       ? add_view(shorts, kElementArrayBuffer)
                                              : add_view(longs, kElementArrayBuffer);
    return add("accessors", {{"bufferView", view},
                             {"componentType", is_short ? kUnsignedShort : kUnsignedInt},
                             {"type", "SCALAR"},
                             {"count", 3 * mesh.triangles.size()}});
  }

  std::size_t add_packed_indices(const geometry::TriangleMesh& mesh, bool is_short) {
    std::vector<unsigned int> corners;
    for (const geometry::Triangle& t : mesh.triangles) corners.insert(corners.end(), t.begin(), t.end());
    std::vector<unsigned char> packed(meshopt_encodeIndexBufferBound(corners.size(), mesh.vertices.size()));
    packed.resize(meshopt_encodeIndexBuffer(packed.data(), packed.size(), corners.data(), corners.size()));
    return add_packed(packed, corners.size(), is_short ? 2 : 4, "TRIANGLES", kElementArrayBuffer);
  }

  std::size_t add_material(const TexturedMesh& mesh) {
    json pbr{{"metallicFactor", 0.0}, {"roughnessFactor", 1.0}, {"baseColorFactor", mesh.base_color}};
    if (mesh.texture) pbr["baseColorTexture"] = {{"index", add_texture(mesh)}};
    return add("materials", {{"pbrMetallicRoughness", pbr},
                             {"doubleSided", true},
                             {"extensions", {{"KHR_materials_unlit", json::object()}}}});
  }

  /// Adds an image once, however many meshes share it.
  std::size_t add_texture(const TexturedMesh& mesh) {
    const auto found = image_of_.find(mesh.texture.get());
    std::size_t image = 0;
    if (found != image_of_.end()) {
      image = found->second;
    } else {
      const std::size_t view = add_view(imaging::encode_jpeg(*mesh.texture, options_.jpeg_quality), 0);
      image = add("images", {{"bufferView", view}, {"mimeType", "image/jpeg"}});
      image_of_[mesh.texture.get()] = image;
    }
    const std::size_t sampler = add("samplers", {{"magFilter", kLinear},
                                                 {"minFilter", kLinearMipmapLinear},
                                                 {"wrapS", wrap(mesh.wrap_u)},
                                                 {"wrapT", wrap(mesh.wrap_v)}});
    return add("textures", {{"source", image}, {"sampler", sampler}});
  }

  static int wrap(imaging::Wrap wrap) {
    if (wrap == imaging::Wrap::kRepeat) return kRepeat;
    return wrap == imaging::Wrap::kClampToEdge ? kClampToEdge : kMirroredRepeat;
  }

  const GlbOptions& options_;
  json json_;
  json primitives_ = json::array();
  std::string binary_;
  std::size_t unpacked_bytes_ = 0;  ///< of packed views
  std::map<const imaging::RgbImage*, std::size_t> image_of_;
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
  Document document(options);
  const Vec3 node = node_of(meshes);
  for (const TexturedMesh& mesh : meshes) {
    assert(mesh.colors.empty() || mesh.colors.size() == mesh.mesh.vertices.size());
    if (mesh.mesh.triangles.empty()) continue;
    document.add_mesh(options.meshopt ? ordered_for_packing(mesh) : mesh, node);
  }
  return document.finish(node);
}

}  // namespace tileflight::tile_writer
