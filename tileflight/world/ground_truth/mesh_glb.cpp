#include "tileflight/world/ground_truth/mesh_glb.h"

#include <tbb/parallel_for.h>
#include <tiny_gltf.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <fstream>
#include <map>
#include <mutex>
#include <nlohmann/json.hpp>
#include <numeric>
#include <span>
#include <sstream>
#include <stdexcept>
#include <string>

#include "tileflight/core/base/files.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/imaging/image_files.h"

namespace tileflight::ground_truth {

namespace {

using geometry::Mat4;
using geometry::TriangleMesh;
using geometry::Vec3;
using imaging::TexturedMesh;

/// Key of a mesh's `extras` that stores its MeshOrigin: {content, first, view: buffer view of `triangles`}.
constexpr const char* kOriginKey = "tileflight_origin";

/// z-up to y-up: (x, y, z) becomes (x, z, -y).
Mat4 T_gltf_local() {
  Mat4 m = Mat4::Identity();
  m.row(1) = Eigen::RowVector4d(0, 0, 1, 0);
  m.row(2) = Eigen::RowVector4d(0, -1, 0, 0);
  return m;
}

constexpr int kJpegQuality = 90;

int gltf_wrap(imaging::Wrap wrap) {
  switch (wrap) {
    case imaging::Wrap::kRepeat:
      return TINYGLTF_TEXTURE_WRAP_REPEAT;
    case imaging::Wrap::kClampToEdge:
      return TINYGLTF_TEXTURE_WRAP_CLAMP_TO_EDGE;
    case imaging::Wrap::kMirroredRepeat:
      return TINYGLTF_TEXTURE_WRAP_MIRRORED_REPEAT;
  }
  return TINYGLTF_TEXTURE_WRAP_REPEAT;
}

using EncodedImages = std::map<const imaging::RgbImage*, std::vector<std::byte>>;

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

/// A stretch of a GLB's binary chunk, made when it is written.
struct GlbPart {
  std::size_t offset = 0, size = 0;            ///< bytes
  std::span<const std::byte> bytes;            ///< empty for positions
  const TriangleMesh* positions_of = nullptr;  ///< vertices, as floats relative to the centre
  Vec3 center = Vec3::Zero();
};

/// The limit of a GLB file, with room for its JSON.
constexpr std::size_t kMostBinary_bytes = 0xf0000000U;

/// Collects meshes into a glTF model with one buffer, whose bytes are not held but referred to: the meshes must outlive
/// it.
class GlbBuilder {
 public:
  explicit GlbBuilder(const EncodedImages& images) : images_(images) {
    model_.asset.version = "2.0";
    model_.asset.generator = "tileflight";
    model_.extensionsUsed.push_back("KHR_materials_unlit");
    model_.buffers.emplace_back();
    model_.nodes.emplace_back();
    model_.nodes[0].name = "local frame: x east, y north, z up";
    const Mat4 turn = T_gltf_local();
    model_.nodes[0].matrix.assign(turn.data(), turn.data() + 16);  // column-major, as glTF requires
    model_.scenes.emplace_back();
    model_.scenes[0].nodes.push_back(0);
    model_.defaultScene = 0;
  }

  void add(const TexturedMesh& m, const Vec3& center, const MeshOrigin* origin) {
    if (m.mesh.triangles.empty()) return;
    tinygltf::Primitive primitive;
    primitive.mode = TINYGLTF_MODE_TRIANGLES;
    primitive.attributes["POSITION"] = add_positions(m.mesh, center);
    if (!m.uv.empty()) {
      primitive.attributes["TEXCOORD_0"] = add_accessor(std::span(m.uv), TINYGLTF_COMPONENT_TYPE_FLOAT,
                                                        TINYGLTF_TYPE_VEC2, TINYGLTF_TARGET_ARRAY_BUFFER);
    }
    if (!m.colors.empty()) {
      primitive.attributes["COLOR_0"] = add_accessor(std::span(m.colors), TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE,
                                                     TINYGLTF_TYPE_VEC4, TINYGLTF_TARGET_ARRAY_BUFFER);
      model_.accessors.back().normalized = true;
    }
    const std::span corners(m.mesh.triangles.front().data(), 3 * m.mesh.triangles.size());
    primitive.indices = add_accessor(corners, TINYGLTF_COMPONENT_TYPE_UNSIGNED_INT, TINYGLTF_TYPE_SCALAR,
                                     TINYGLTF_TARGET_ELEMENT_ARRAY_BUFFER);
    primitive.material = add_material(m);
    add_node(m.name, center, std::move(primitive));
    if (origin == nullptr) return;
    tinygltf::Value::Object stored;
    stored["content"] = tinygltf::Value(static_cast<int>(origin->content));
    stored["first"] = tinygltf::Value(static_cast<int>(origin->first));
    stored["view"] = tinygltf::Value(add_view(std::as_bytes(std::span(origin->triangles)), 0));
    model_.meshes.back().extras = tinygltf::Value(tinygltf::Value::Object{{kOriginKey, tinygltf::Value(stored)}});
  }

  std::size_t buffer_bytes() const { return bytes_; }
  const std::vector<GlbPart>& parts() const { return parts_; }

  /// Everything before the first part: header, JSON, head of the binary chunk.
  std::string head() const {
    std::ostringstream stream;
    tinygltf::TinyGLTF writer;
    writer.WriteGltfSceneToStream(&model_, stream, false, true);
    std::string json = std::move(stream).str().substr(kHeader_bytes + kChunkHead_bytes);
    json.erase(json.find_last_not_of(' ') + 1);
    // The model's buffer is empty, since its bytes are not held. Within a JSON string the quotes would be escaped.
    const std::string unknown = R"("buffers":[{"byteLength":0}])";
    json.replace(json.find(unknown), unknown.size(), R"("buffers":[{"byteLength":)" + std::to_string(bytes_) + "}]");
    json.append(padding(json.size()), ' ');
    const std::size_t binary = bytes_ + padding(bytes_);
    const auto word = [](std::size_t value) {
      const auto number = static_cast<std::uint32_t>(value);
      return std::string(reinterpret_cast<const char*>(&number), sizeof number);
    };
    return "glTF" + word(2) + word(kHeader_bytes + 2 * kChunkHead_bytes + json.size() + binary) + word(json.size()) +
           "JSON" + json + word(binary) + std::string("BIN\0", 4);
  }

  /// Bytes to the next multiple of four: accessors are aligned to the size of their numbers, chunks to four bytes.
  static std::size_t padding(std::size_t bytes) { return (4 - bytes % 4) % 4; }

 private:
  int add_view(GlbPart part, int target) {
    part.offset = bytes_ + padding(bytes_);
    bytes_ = part.offset + part.size;
    parts_.push_back(part);
    tinygltf::BufferView view;
    view.buffer = 0;
    view.byteOffset = part.offset;
    view.byteLength = part.size;
    view.target = target;
    model_.bufferViews.push_back(view);
    return static_cast<int>(model_.bufferViews.size() - 1);
  }
  int add_view(std::span<const std::byte> bytes, int target) {
    return add_view(GlbPart{.size = bytes.size(), .bytes = bytes}, target);
  }

  int add_accessor(int view, std::size_t count, int component_type, int type) {
    tinygltf::Accessor accessor;
    accessor.bufferView = view;
    accessor.componentType = component_type;
    accessor.type = type;
    accessor.count = count;
    model_.accessors.push_back(accessor);
    return static_cast<int>(model_.accessors.size() - 1);
  }
  template <typename T>
  int add_accessor(std::span<const T> values, int component_type, int type, int target) {
    return add_accessor(add_view(std::as_bytes(values), target), values.size(), component_type, type);
  }
  template <typename T>
  int add_accessor(std::span<T> values, int component_type, int type, int target) {
    return add_accessor(std::span<const T>(values), component_type, type, target);
  }

  int add_positions(const TriangleMesh& mesh, const Vec3& center) {
    Eigen::AlignedBox3f box;
    for (const Vec3& v : mesh.vertices) box.extend((v - center).cast<float>());
    const std::size_t count = mesh.vertices.size();
    const GlbPart part{.size = count * sizeof(Eigen::Vector3f), .positions_of = &mesh, .center = center};
    const int accessor = add_accessor(add_view(part, TINYGLTF_TARGET_ARRAY_BUFFER), count,
                                      TINYGLTF_COMPONENT_TYPE_FLOAT, TINYGLTF_TYPE_VEC3);
    model_.accessors.back().minValues = {box.min().x(), box.min().y(), box.min().z()};
    model_.accessors.back().maxValues = {box.max().x(), box.max().y(), box.max().z()};
    return accessor;
  }

  int add_material(const TexturedMesh& m) {
    tinygltf::Material material;
    auto& pbr = material.pbrMetallicRoughness;
    pbr.baseColorFactor.assign(m.base_color.begin(), m.base_color.end());
    pbr.metallicFactor = 0.0;
    pbr.roughnessFactor = 1.0;
    if (images_.contains(m.texture.get())) pbr.baseColorTexture.index = add_texture(m);
    material.doubleSided = true;
    material.extensions["KHR_materials_unlit"] = tinygltf::Value(tinygltf::Value::Object());
    model_.materials.push_back(material);
    return static_cast<int>(model_.materials.size() - 1);
  }

  int add_texture(const TexturedMesh& m) {
    const auto [found, is_new] = image_index_.try_emplace(m.texture.get(), static_cast<int>(model_.images.size()));
    if (is_new) {
      tinygltf::Image image;
      image.bufferView = add_view(images_.at(m.texture.get()), 0);
      image.mimeType = "image/jpeg";
      model_.images.push_back(image);
    }
    tinygltf::Sampler sampler;
    sampler.minFilter = TINYGLTF_TEXTURE_FILTER_LINEAR_MIPMAP_LINEAR;
    sampler.magFilter = TINYGLTF_TEXTURE_FILTER_LINEAR;
    sampler.wrapS = gltf_wrap(m.wrap_u);
    sampler.wrapT = gltf_wrap(m.wrap_v);
    model_.samplers.push_back(sampler);
    tinygltf::Texture texture;
    texture.source = found->second;
    texture.sampler = static_cast<int>(model_.samplers.size() - 1);
    model_.textures.push_back(texture);
    return static_cast<int>(model_.textures.size() - 1);
  }

  void add_node(const std::string& name, const Vec3& center, tinygltf::Primitive primitive) {
    tinygltf::Mesh mesh;
    mesh.name = name;
    mesh.primitives.push_back(std::move(primitive));
    model_.meshes.push_back(std::move(mesh));
    tinygltf::Node node;
    node.name = name;
    node.mesh = static_cast<int>(model_.meshes.size() - 1);
    node.translation = {center.x(), center.y(), center.z()};
    model_.nodes[0].children.push_back(static_cast<int>(model_.nodes.size()));
    model_.nodes.push_back(std::move(node));
  }

  static constexpr std::size_t kHeader_bytes = 12, kChunkHead_bytes = 8;

  const EncodedImages& images_;
  std::map<const imaging::RgbImage*, int> image_index_;
  tinygltf::Model model_;
  std::vector<GlbPart> parts_;
  std::size_t bytes_ = 0;  ///< of all parts, with the gaps between them
};

/// Returns the bytes of a GLB file piece by piece, holding some hundred thousand of them at a time; empty: the end.
class GlbStream {
 public:
  explicit GlbStream(const GlbBuilder& glb) : glb_(glb), piece_(glb.head()) {}

  std::string_view next() {
    if (!begun_) {
      begun_ = true;
      return piece_;
    }
    piece_.clear();
    while (piece_.empty() && part_ < glb_.parts().size()) append_some(glb_.parts()[part_]);
    if (piece_.empty() && !ended_) {
      ended_ = true;
      piece_.assign(GlbBuilder::padding(glb_.buffer_bytes()), '\0');
    }
    return piece_;
  }

 private:
  static constexpr std::size_t kAtOnce = 65536;  ///< positions

  void append_some(const GlbPart& part) {
    if (done_ == 0) piece_.assign(GlbBuilder::padding(written_), '\0');
    written_ += piece_.size();
    const std::size_t end = std::min(part.size, done_ + kAtOnce * sizeof(Eigen::Vector3f));
    if (part.positions_of != nullptr) {
      for (std::size_t at = done_; at < end; at += sizeof(Eigen::Vector3f)) {
        const Vec3& v = part.positions_of->vertices[at / sizeof(Eigen::Vector3f)];
        const Eigen::Vector3f p = (v - part.center).cast<float>();
        piece_.append(reinterpret_cast<const char*>(p.data()), sizeof p);
      }
    } else {
      piece_.append(reinterpret_cast<const char*>(part.bytes.data()) + done_, end - done_);
    }
    written_ += end - done_;
    done_ = end;
    if (done_ < part.size) return;
    done_ = 0;
    ++part_;
  }

  const GlbBuilder& glb_;
  std::string piece_;
  bool begun_ = false, ended_ = false;
  std::size_t part_ = 0;     ///< the one to be written next
  std::size_t done_ = 0;     ///< bytes of it
  std::size_t written_ = 0;  ///< bytes of the binary chunk
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
  GlbBuilder builder(images);
  for (std::size_t i = 0; i < meshes.size(); ++i) {
    builder.add(meshes[i], centers.empty() ? Vec3(geometry::bounds(meshes[i].mesh).center()) : centers[i],
                origins.empty() ? nullptr : &origins[i]);
  }
  require_fitting(file.string(), builder.buffer_bytes());
  GlbStream stream(builder);
  base::write_file_in_parts(file, [&] { return stream.next(); });
}

namespace {

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
