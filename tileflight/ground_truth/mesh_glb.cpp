#include "tileflight/ground_truth/mesh_glb.h"

#include <tbb/parallel_for.h>
#include <tiny_gltf.h>

#include <cmath>
#include <cstring>
#include <map>
#include <mutex>
#include <span>
#include <sstream>
#include <string>

#include "tileflight/base/files.h"
#include "tileflight/base/input_error.h"
#include "tileflight/imaging/image_files.h"

namespace tileflight::ground_truth {
namespace {

using geometry::Mat4;
using geometry::TriangleMesh;
using geometry::Vec3;
using imaging::TexturedMesh;

constexpr int kJpegQuality = 90;

/// z-up to y-up: (x, y, z) becomes (x, z, -y).
Mat4 T_gltf_local() {
  Mat4 m = Mat4::Identity();
  m.row(1) = Eigen::RowVector4d(0, 0, 1, 0);
  m.row(2) = Eigen::RowVector4d(0, -1, 0, 0);
  return m;
}

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

/// Collects meshes into a glTF model with one buffer.
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

  void add(const TexturedMesh& m, const Vec3& center) {
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
  }

  const tinygltf::Model& model() const { return model_; }
  std::size_t buffer_bytes() const { return model_.buffers[0].data.size(); }

 private:
  int add_view(std::span<const std::byte> bytes, int target) {
    auto& data = model_.buffers[0].data;
    data.resize((data.size() + 3) / 4 * 4);  // accessors are aligned to the size of their numbers
    tinygltf::BufferView view;
    view.buffer = 0;
    view.byteOffset = data.size();
    view.byteLength = bytes.size();
    view.target = target;
    const auto* first = reinterpret_cast<const unsigned char*>(bytes.data());
    data.insert(data.end(), first, first + bytes.size());
    model_.bufferViews.push_back(view);
    return static_cast<int>(model_.bufferViews.size() - 1);
  }

  template <typename T>
  int add_accessor(std::span<const T> values, int component_type, int type, int target) {
    tinygltf::Accessor accessor;
    accessor.bufferView = add_view(std::as_bytes(values), target);
    accessor.componentType = component_type;
    accessor.type = type;
    accessor.count = values.size();
    model_.accessors.push_back(accessor);
    return static_cast<int>(model_.accessors.size() - 1);
  }
  template <typename T>
  int add_accessor(std::span<T> values, int component_type, int type, int target) {
    return add_accessor(std::span<const T>(values), component_type, type, target);
  }

  int add_positions(const TriangleMesh& mesh, const Vec3& center) {
    std::vector<Eigen::Vector3f> positions;
    Eigen::AlignedBox3f box;
    for (const Vec3& v : mesh.vertices) {
      positions.push_back((v - center).cast<float>());
      box.extend(positions.back());
    }
    const int accessor = add_accessor(std::span(positions), TINYGLTF_COMPONENT_TYPE_FLOAT, TINYGLTF_TYPE_VEC3,
                                      TINYGLTF_TARGET_ARRAY_BUFFER);
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

  const EncodedImages& images_;
  std::map<const imaging::RgbImage*, int> image_index_;
  tinygltf::Model model_;
};

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

  TriangleMesh read() {
    if (model_.scenes.empty()) throw InputError(file_, "has no scene");
    const auto scene = static_cast<std::size_t>(std::max(model_.defaultScene, 0));
    for (const int node : at(model_.scenes, scene, "scene").nodes) add_node(node, T_gltf_local().inverse(), 0);
    if (mesh_.triangles.empty()) throw InputError(file_, "has no triangles");
    return std::move(mesh_);
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
    for (const auto& primitive : at(model_.meshes, static_cast<std::size_t>(node.mesh), "mesh").primitives) {
      add_primitive(primitive, T_local_node);
    }
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
    const auto& view = at(model_.bufferViews, static_cast<std::size_t>(accessor.bufferView), "buffer view");
    const auto& data = at(model_.buffers, static_cast<std::size_t>(view.buffer), "buffer").data;
    const std::size_t begin = view.byteOffset + accessor.byteOffset;
    if (view.byteStride != 0 && view.byteStride != sizeof(T)) throw InputError(file_, "its accessors are interleaved");
    if (begin > data.size() || accessor.count > (data.size() - begin) / sizeof(T)) {
      throw InputError(file_, "an accessor reaches beyond the file: it is truncated or damaged");
    }
    std::vector<T> values(accessor.count);
    if (!values.empty()) std::memcpy(static_cast<void*>(values.data()), data.data() + begin, values.size() * sizeof(T));
    return values;
  }

  const tinygltf::Model& model_;
  std::string file_;
  TriangleMesh mesh_;
};

/// Prevents tinygltf from decoding the textures, which are not needed.
bool leave_image(tinygltf::Image*, int, std::string*, std::string*, int, int, const unsigned char*, int, void*) {
  return true;
}

/// The first line of tinygltf's message.
std::string one_line(const std::string& text) { return text.substr(0, text.find('\n')); }

}  // namespace

void write_mesh_glb(const std::filesystem::path& file, const std::vector<TexturedMesh>& meshes, bool textures,
                    const Progress& progress, const std::vector<Vec3>& centers) {
  const EncodedImages images = textures ? encode_textures(meshes, progress) : EncodedImages();
  GlbBuilder builder(images);
  for (std::size_t i = 0; i < meshes.size(); ++i)
    builder.add(meshes[i], centers.empty() ? Vec3(geometry::bounds(meshes[i].mesh).center()) : centers[i]);
  if (builder.buffer_bytes() > 0xf0000000U) {
    throw InputError(file.string(),
                     "would be larger than the 4 GiB of a GLB file: choose a smaller region or a larger "
                     "geometric error");
  }
  std::ostringstream stream;
  tinygltf::TinyGLTF writer;
  writer.WriteGltfSceneToStream(&builder.model(), stream, false, true);
  base::write_file(file, std::move(stream).str());
}

TriangleMesh read_mesh_glb(const std::filesystem::path& file) {
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

}  // namespace tileflight::ground_truth
