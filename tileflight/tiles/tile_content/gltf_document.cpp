#include "tileflight/tiles/tile_content/gltf_document.h"

#include <algorithm>
#include <array>
#include <cstddef>
#include <map>
#include <optional>
#include <string>
#include <string_view>

#include "tileflight/core/base/input_error.h"
#include "tileflight/tiles/tile_content/json_reader.h"
#include "tileflight/tiles/tile_content/metadata_schema.h"

namespace tileflight::tile_content::gltf {
namespace {

using geometry::Mat4;
using geometry::Vec3;

ComponentType component_type(std::size_t code, const std::string& where) {
  switch (code) {
    case 5120:
      return ComponentType::kInt8;
    case 5121:
      return ComponentType::kUint8;
    case 5122:
      return ComponentType::kInt16;
    case 5123:
      return ComponentType::kUint16;
    case 5125:
      return ComponentType::kUint32;
    case 5126:
      return ComponentType::kFloat;
    default:
      throw InputError(where, "componentType " + std::to_string(code) + " is not defined by glTF");
  }
}

/// Reads an index into an array of `size` entries, all of which have been read.
std::optional<std::size_t> find_reference(const Json& object, const char* key, std::size_t size,
                                          const std::string& where) {
  const auto index = find_index(object, key, where);
  if (index && *index >= size) {
    throw InputError(where, std::string(key) + " " + std::to_string(*index) + " does not exist; the file has " +
                                std::to_string(size));
  }
  return index;
}

/// Returns an extension of an object, or nullptr if it has none of that name.
const Json* find_extension(const Json& object, const char* name, const std::string& where) {
  const Json* extensions = find_object(object, "extensions", where);
  return extensions == nullptr ? nullptr : find_object(*extensions, name, where);
}

MeshoptView read_meshopt(const Json& json, const Document& document, const std::string& where) {
  MeshoptView view;
  view.buffer = require_value(find_reference(json, "buffer", document.buffers.size(), where), "buffer", where);
  view.byte_offset = find_index(json, "byteOffset", where).value_or(0);
  view.byte_length = require_value(find_index(json, "byteLength", where), "byteLength", where);
  view.byte_stride = require_value(find_index(json, "byteStride", where, 256), "byteStride", where);
  view.count = require_value(find_index(json, "count", where), "count", where);
  view.mode = require_value(find_string(json, "mode", where), "mode", where);
  view.filter = find_string(json, "filter", where).value_or("NONE");
  return view;
}

SparseAccessor read_sparse(const Json& json, const Document& document, const std::string& where) {
  const Json* indices = find_object(json, "indices", where);
  const Json* values = find_object(json, "values", where);
  if (indices == nullptr || values == nullptr) throw InputError(where, "indices or values are missing");
  SparseAccessor sparse;
  sparse.count = require_value(find_index(json, "count", where), "count", where);
  sparse.indices_view =
      require_value(find_reference(*indices, "bufferView", document.views.size(), where), "bufferView", where);
  sparse.indices_offset = find_index(*indices, "byteOffset", where).value_or(0);
  sparse.indices_type =
      component_type(require_value(find_index(*indices, "componentType", where), "componentType", where), where);
  sparse.values_view =
      require_value(find_reference(*values, "bufferView", document.views.size(), where), "bufferView", where);
  sparse.values_offset = find_index(*values, "byteOffset", where).value_or(0);
  return sparse;
}

Buffer read_buffer(const Json& json, const std::string& where) {
  return {find_string(json, "uri", where), require_value(find_index(json, "byteLength", where), "byteLength", where)};
}

/// Reads a view of a document whose buffers have been read.
BufferView read_view(const Json& json, const Document& document, const std::string& where) {
  BufferView view;
  view.buffer = require_value(find_reference(json, "buffer", document.buffers.size(), where), "buffer", where);
  view.byte_offset = find_index(json, "byteOffset", where).value_or(0);
  view.byte_length = require_value(find_index(json, "byteLength", where), "byteLength", where);
  view.byte_stride = find_index(json, "byteStride", where, 252).value_or(0);
  if (const Json* ext = find_extension(json, "EXT_meshopt_compression", where))
    view.meshopt = read_meshopt(*ext, document, where);
  return view;
}

/// Reads an accessor of a document whose views have been read.
Accessor read_accessor(const Json& json, const Document& document, const std::string& where) {
  Accessor accessor;
  accessor.view = find_reference(json, "bufferView", document.views.size(), where);
  accessor.byte_offset = find_index(json, "byteOffset", where).value_or(0);
  accessor.type =
      component_type(require_value(find_index(json, "componentType", where), "componentType", where), where);
  accessor.components = component_count(require_value(find_string(json, "type", where), "type", where), where);
  accessor.count = require_value(find_index(json, "count", where), "count", where);
  accessor.normalized = find_bool(json, "normalized", where).value_or(false);
  if (const Json* s = find_object(json, "sparse", where))
    accessor.sparse = read_sparse(*s, document, where + ": sparse");
  return accessor;
}

imaging::Wrap wrap_mode(std::size_t code, const std::string& where) {
  switch (code) {
    case 10497:
      return imaging::Wrap::kRepeat;
    case 33071:
      return imaging::Wrap::kClampToEdge;
    case 33648:
      return imaging::Wrap::kMirroredRepeat;
    default:
      throw InputError(where, "wrap mode " + std::to_string(code) + " is not defined by glTF");
  }
}

Mat4 node_matrix(const Json& node, const std::string& where) {
  if (const auto m = find_numbers(node, "matrix", 16, where)) return Eigen::Map<const Mat4>(m->data());
  const auto t = find_numbers(node, "translation", 3, where).value_or(std::vector<double>{0, 0, 0});
  const auto r = find_numbers(node, "rotation", 4, where).value_or(std::vector<double>{0, 0, 0, 1});
  const auto s = find_numbers(node, "scale", 3, where).value_or(std::vector<double>{1, 1, 1});
  const Eigen::Quaterniond rotation(r[3], r[0], r[1], r[2]);
  if (!(rotation.norm() > 0)) throw InputError(where, "the rotation is a quaternion of length 0");
  Mat4 matrix = Mat4::Identity();
  matrix.topLeftCorner<3, 3>() = rotation.normalized().toRotationMatrix() * Vec3(s[0], s[1], s[2]).asDiagonal();
  matrix.topRightCorner<3, 1>() = Vec3(t[0], t[1], t[2]);
  return matrix;
}

/// One object per file; each method reads one of the top-level arrays.
class DocumentParser {
 public:
  DocumentParser(const Json& json, const std::string& name) : json_(json), name_(name) {}

  Document parse() {
    if (!json_.is_object()) throw InputError(name_, "is not a glTF: expected a JSON object");
    parse_asset();
    out_.extensions_used = find_strings(json_, "extensionsUsed", name_);
    out_.extensions_required = find_strings(json_, "extensionsRequired", name_);
    parse_rtc();
    if (const Json* metadata = find_extension(json_, "EXT_structural_metadata", name_)) {
      out_.structural_metadata = std::make_shared<const Json>(*metadata);
    }
    each("buffers", [&](const Json& j, const std::string& w) { out_.buffers.push_back(read_buffer(j, w)); });
    each("bufferViews", [&](const Json& j, const std::string& w) { out_.views.push_back(read_view(j, out_, w)); });
    each("accessors",
         [&](const Json& j, const std::string& w) { out_.accessors.push_back(read_accessor(j, out_, w)); });
    each("images", [&](const Json& j, const std::string& w) { out_.images.push_back(image(j, w)); });
    each("textures", [&](const Json& j, const std::string& w) { out_.textures.push_back(texture(j, w)); });
    each("materials", [&](const Json& j, const std::string& w) { out_.materials.push_back(material(j, w)); });
    each("meshes", [&](const Json& j, const std::string& w) { out_.meshes.push_back(mesh(j, w)); });
    const Json* nodes = find_array(json_, "nodes", name_);
    node_count_ = nodes == nullptr ? 0 : nodes->size();
    each("nodes", [&](const Json& j, const std::string& w) { out_.nodes.push_back(node(j, w)); });
    find_roots();
    return std::move(out_);
  }

 private:
  template <class Function>
  void each(const char* key, const Function& function) {
    const Json* array = find_array(json_, key, name_);
    if (array == nullptr) return;
    for (std::size_t i = 0; i < array->size(); ++i) {
      const std::string where = name_ + ": " + key + "[" + std::to_string(i) + "]";
      if (!(*array)[i].is_object()) throw InputError(where, "is not an object");
      function((*array)[i], where);
    }
  }

  void parse_asset() {
    const std::string where = name_ + ": asset";
    const Json* asset = find_object(json_, "asset", name_);
    const std::string version = asset == nullptr ? "1.0" : find_version(*asset, "version", where).value_or("");
    if (version != "2" && !version.starts_with("2.")) {
      throw InputError(name_, "glTF version '" + version + "' is not supported, only 2.0: upgrade the tileset");
    }
    out_.copyright = find_string(*asset, "copyright", where).value_or("");
  }

  void parse_rtc() {
    const Json* rtc = find_extension(json_, "CESIUM_RTC", name_);
    if (rtc == nullptr) return;
    const auto c =
        require_value(find_numbers(*rtc, "center", 3, name_ + ": CESIUM_RTC"), "center", name_ + ": CESIUM_RTC");
    out_.rtc_center = Vec3(c[0], c[1], c[2]);
  }

  Image image(const Json& json, const std::string& where) const {
    Image image{find_string(json, "uri", where), find_reference(json, "bufferView", out_.views.size(), where)};
    if (!image.uri && !image.view) throw InputError(where, "has no uri and no bufferView");
    return image;
  }

  Texture texture(const Json& json, const std::string& where) const {
    Texture texture;
    texture.image = find_reference(json, "source", out_.images.size(), where);
    if (const Json* webp = find_extension(json, "EXT_texture_webp", where)) {
      texture.image = require_value(find_reference(*webp, "source", out_.images.size(), where), "source", where);
    }
    // A plain image given as a fallback is preferred: it is equivalent and cheaper to decode.
    if (const Json* basis = find_extension(json, "KHR_texture_basisu", where); basis != nullptr && !texture.image) {
      texture.image = require_value(find_reference(*basis, "source", out_.images.size(), where), "source", where);
    }
    if (!texture.image) texture.unsupported = lacking_image_format(json, where);
    set_wrap(texture, json, where);
    return texture;
  }

  static std::string lacking_image_format(const Json& json, const std::string& where) {
    const Json* extensions = find_object(json, "extensions", where);
    return extensions == nullptr || extensions->empty() ? "" : extensions->begin().key();
  }

  void set_wrap(Texture& texture, const Json& json, const std::string& where) const {
    const Json* samplers = find_array(json_, "samplers", name_);
    const auto index = find_reference(json, "sampler", samplers == nullptr ? 0 : samplers->size(), where);
    if (!index) return;
    texture.wrap_u = wrap_mode(find_index((*samplers)[*index], "wrapS", where).value_or(10497), where);
    texture.wrap_v = wrap_mode(find_index((*samplers)[*index], "wrapT", where).value_or(10497), where);
  }

  Material material(const Json& json, const std::string& where) const {
    Material out;
    if (const Json* pbr = find_object(json, "pbrMetallicRoughness", where)) {
      out = base_color(*pbr, "baseColorFactor", "baseColorTexture", where);
    } else if (const Json* specular = find_extension(json, "KHR_materials_pbrSpecularGlossiness", where)) {
      out = base_color(*specular, "diffuseFactor", "diffuseTexture", where);
    }
    read_alpha(json, out, where);
    read_emission(json, out, where);
    name_ignored_extensions(json, out, where);
    return out;
  }

  static void read_alpha(const Json& json, Material& out, const std::string& where) {
    const std::string mode = find_string(json, "alphaMode", where).value_or("OPAQUE");
    if (mode == "MASK") out.alpha_mode = AlphaMode::kMask;
    if (mode == "BLEND") out.alpha_mode = AlphaMode::kBlend;
    out.alpha_cutoff = find_number(json, "alphaCutoff", where).value_or(0.5);
  }

  /// A surface that only shines (black, or without a texture of its own) is shown by the light that it sends out.
  void read_emission(const Json& json, Material& out, const std::string& where) const {
    const auto factor = find_numbers(json, "emissiveFactor", 3, where);
    const bool shines = factor && std::any_of(factor->begin(), factor->end(), [](double f) { return f > 0.0; });
    if (!shines) return;
    const Json* texture = find_object(json, "emissiveTexture", where);
    const auto& color = out.base_color;
    const bool is_black = color[0] == 0.0F && color[1] == 0.0F && color[2] == 0.0F;
    const bool is_plain = texture != nullptr && !out.base_color_texture;
    if (!is_black && !is_plain) {
      out.warnings.emplace_back("the light that materials send out (emissive) is ignored; their own colour is shown");
      return;
    }
    for (std::size_t i = 0; i < 3; ++i) out.base_color[i] = static_cast<float>(std::clamp((*factor)[i], 0.0, 1.0));
    out.base_color_texture.reset();
    if (texture != nullptr) out.base_color_texture = texture_reference(*texture, where);
    out.warnings.emplace_back("materials that only send out light (emissive) are shown in that light's colour");
  }

  /// Extensions that decide the colour or the transparency of a surface and are not read.
  static void name_ignored_extensions(const Json& json, Material& out, const std::string& where) {
    const Json* extensions = find_object(json, "extensions", where);
    if (extensions == nullptr) return;
    static constexpr std::array<std::string_view, 13> kHarmless = {
        "KHR_materials_unlit",      "KHR_materials_pbrSpecularGlossiness",
        "KHR_materials_specular",   "KHR_materials_ior",
        "KHR_materials_clearcoat",  "KHR_materials_sheen",
        "KHR_materials_anisotropy", "KHR_materials_iridescence",
        "KHR_materials_dispersion", "KHR_materials_emissive_strength",
        "KHR_materials_variants",   "EXT_structural_metadata",
        "KHR_xmp_json_ld"};
    for (const auto& [name, unused] : extensions->items()) {
      if (std::find(kHarmless.begin(), kHarmless.end(), name) != kHarmless.end()) continue;
      const bool is_clear = name == "KHR_materials_transmission" || name == "KHR_materials_volume" ||
                            name == "KHR_materials_diffuse_transmission";
      out.warnings.push_back("the material extension " + name + " is ignored; its surfaces are shown " +
                             (is_clear ? "opaque"
                              : out.base_color_texture
                                  ? "by their base colour"
                                  : "in one colour (white where the material states no base colour)"));
    }
  }

  Material base_color(const Json& json, const char* factor, const char* texture, const std::string& where) const {
    Material material;
    if (const auto c = find_numbers(json, factor, 4, where)) {
      for (std::size_t i = 0; i < 4; ++i) {
        material.base_color[i] = static_cast<float>(std::clamp((*c)[i], 0.0, 1.0));
      }
    }
    if (const Json* t = find_object(json, texture, where)) material.base_color_texture = texture_reference(*t, where);
    return material;
  }

  TextureReference texture_reference(const Json& json, const std::string& where) const {
    TextureReference out;
    out.texture = require_value(find_reference(json, "index", out_.textures.size(), where), "index", where);
    out.tex_coord = find_index(json, "texCoord", where, 255).value_or(0);
    if (const Json* transform = find_extension(json, "KHR_texture_transform", where)) {
      TextureTransform t;
      if (const auto v = find_numbers(*transform, "offset", 2, where)) t.offset = {(*v)[0], (*v)[1]};
      if (const auto v = find_numbers(*transform, "scale", 2, where)) t.scale = {(*v)[0], (*v)[1]};
      t.rotation_rad = find_number(*transform, "rotation", where).value_or(0.0);
      out.tex_coord = find_index(*transform, "texCoord", where, 255).value_or(out.tex_coord);
      out.transform = t;
    }
    return out;
  }

  Mesh mesh(const Json& json, const std::string& where) const {
    Mesh mesh;
    const Json* primitives = find_array(json, "primitives", where);
    if (primitives == nullptr) throw InputError(where, "primitives are missing");
    for (const Json& p : *primitives) mesh.primitives.push_back(primitive(p, where + ": primitive"));
    return mesh;
  }

  Primitive primitive(const Json& json, const std::string& where) const {
    Primitive out;
    out.mode = static_cast<int>(find_index(json, "mode", where, 6).value_or(4));
    const Json* attributes = find_object(json, "attributes", where);
    if (attributes == nullptr) throw InputError(where, "attributes are missing");
    for (const auto& [key, unused] : attributes->items()) {
      const auto index = find_reference(*attributes, key.c_str(), out_.accessors.size(), where);
      if (index) out.attributes[key] = *index;
    }
    out.indices = find_reference(json, "indices", out_.accessors.size(), where);
    out.material = find_reference(json, "material", out_.materials.size(), where);
    if (const Json* ext = find_extension(json, "KHR_draco_mesh_compression", where)) out.draco = draco(*ext, where);
    read_features(out, json, where);
    return out;
  }

  /// The first per-vertex feature id set of EXT_mesh_features, preferring one with a property table; if there is none,
  /// the first set stored in a texture; without the extension, the batch id attribute of 3D Tiles 1.0.
  void read_features(Primitive& out, const Json& json, const std::string& where) const {
    if (const Json* ext = find_extension(json, "EXT_mesh_features", where)) {
      const Json* sets = find_array(*ext, "featureIds", where);
      const std::string here = where + ": EXT_mesh_features";
      const Json* in_texture = nullptr;
      for (std::size_t i = 0; sets != nullptr && i < sets->size(); ++i) {
        const Json& set = (*sets)[i];
        if (find_member(set, "texture") != nullptr) {
          if (in_texture == nullptr) in_texture = &set;
          continue;
        }
        const FeatureIds ids = feature_ids(set, here);
        if (!out.features || (!out.features->property_table && ids.property_table)) out.features = ids;
      }
      if (!out.features && in_texture != nullptr) out.texture_features = texture_features(*in_texture, here);
      return;
    }
    for (const char* attribute : {"_BATCHID", "BATCHID", "_FEATURE_ID_0"}) {
      const bool there = out.attributes.contains(attribute) || (out.draco && out.draco->attributes.contains(attribute));
      if (there && !out.features) out.features = FeatureIds{attribute, std::nullopt, std::nullopt};
    }
  }

  TextureFeatureIds texture_features(const Json& json, const std::string& where) const {
    const Json& texture = *find_object(json, "texture", where);  // the caller has checked that it exists
    TextureFeatureIds out{
        .texture = texture_reference(texture, where), .channels = {0}, .ids = feature_ids(json, where)};
    if (const auto channels = find_numbers(texture, "channels", 0, where)) {
      out.channels.clear();
      for (const double channel : *channels) {
        if (channel != 0 && channel != 1 && channel != 2 && channel != 3)
          throw InputError(where, "has a texture channel that does not exist");
        out.channels.push_back(static_cast<std::size_t>(channel));
      }
      if (out.channels.size() > 4) throw InputError(where, "has more than four channels");
    }
    return out;
  }

  static FeatureIds feature_ids(const Json& json, const std::string& where) {
    FeatureIds out;
    if (const auto n = find_index(json, "attribute", where, 255)) out.attribute = "_FEATURE_ID_" + std::to_string(*n);
    out.property_table = find_index(json, "propertyTable", where, 1 << 20);
    if (const auto null = find_index(json, "nullFeatureId", where, 0xFFFFFFFF)) {
      out.null_id = static_cast<std::uint32_t>(*null);
    }
    return out;
  }

  DracoPrimitive draco(const Json& json, const std::string& where) const {
    DracoPrimitive out;
    out.view = require_value(find_reference(json, "bufferView", out_.views.size(), where), "bufferView", where);
    const Json* attributes = find_object(json, "attributes", where);
    if (attributes == nullptr) throw InputError(where, "KHR_draco_mesh_compression has no attributes");
    for (const auto& [key, unused] : attributes->items()) {
      const auto id = find_index(*attributes, key.c_str(), where, 0xFFFFFFFF);
      if (id) out.attributes[key] = static_cast<std::uint32_t>(*id);
    }
    return out;
  }

  Node node(const Json& json, const std::string& where) const {
    Node out;
    out.T_parent_node = node_matrix(json, where);
    out.mesh = find_reference(json, "mesh", out_.meshes.size(), where);
    if (const Json* children = find_array(json, "children", where)) out.children = node_list(*children, where);
    if (const Json* ext = find_extension(json, "EXT_mesh_gpu_instancing", where))
      out.instancing = instancing(*ext, json, where);
    return out;
  }

  Instancing instancing(const Json& json, const Json& node_json, const std::string& where) const {
    const Json* attributes = find_object(json, "attributes", where);
    if (attributes == nullptr) throw InputError(where, "EXT_mesh_gpu_instancing has no attributes");
    const auto accessor = [&](const char* key) {
      return find_reference(*attributes, key, out_.accessors.size(), where);
    };
    Instancing out;
    out.translation = accessor("TRANSLATION");
    out.rotation = accessor("ROTATION");
    out.scale = accessor("SCALE");
    const Json* ext = find_extension(node_json, "EXT_instance_features", where);
    const Json* sets = ext == nullptr ? nullptr : find_array(*ext, "featureIds", where);
    if (sets == nullptr || sets->empty()) return out;
    out.features = feature_ids((*sets)[0], where + ": EXT_instance_features");
    if (!out.features->attribute.empty()) out.feature_ids = accessor(out.features->attribute.c_str());
    return out;
  }

  std::vector<std::size_t> node_list(const Json& array, const std::string& where) const {
    std::vector<std::size_t> out;
    for (const Json& value : array) {
      if (!value.is_number_unsigned() || value.get<std::size_t>() >= node_count_) {
        throw InputError(where, "refers to a node that does not exist; the file has " + std::to_string(node_count_));
      }
      out.push_back(value.get<std::size_t>());
    }
    return out;
  }

  /// The default scene, else the first; in a file without scenes, all nodes without a parent.
  void find_roots() {
    const Json* scenes = find_array(json_, "scenes", name_);
    if (scenes != nullptr && !scenes->empty()) {
      const std::size_t shown = find_reference(json_, "scene", scenes->size(), name_).value_or(0);
      const std::string where = name_ + ": scenes[" + std::to_string(shown) + "]";
      if (const Json* nodes = find_array((*scenes)[shown], "nodes", where)) out_.roots = node_list(*nodes, where);
      return;
    }
    std::vector<bool> is_child(node_count_, false);
    for (const Node& node : out_.nodes) {
      for (const std::size_t child : node.children) is_child[child] = true;
    }
    for (std::size_t i = 0; i < node_count_; ++i) {
      if (!is_child[i]) out_.roots.push_back(i);
    }
  }

  const Json& json_;
  std::string name_;
  Document out_;
  std::size_t node_count_ = 0;
};

/// Supported required extensions, including those that only affect lighting or metadata.
constexpr std::array<std::string_view, 16> kSupportedExtensions = {
    "KHR_draco_mesh_compression", "EXT_meshopt_compression",  "KHR_mesh_quantization",   "KHR_texture_transform",
    "EXT_texture_webp",           "KHR_texture_basisu",       "EXT_mesh_gpu_instancing", "CESIUM_RTC",
    "KHR_lights_punctual",        "CESIUM_primitive_outline", "EXT_mesh_features",       "EXT_instance_features",
    "EXT_structural_metadata",    "EXT_feature_metadata",     "KHR_xmp_json_ld",         "KHR_xmp"};
/// Relevant for images only.
constexpr std::array<std::string_view, 2> kImageExtensions = {"MSFT_texture_dds", "EXT_texture_avif"};

template <std::size_t N>
bool contains(const std::array<std::string_view, N>& list, const std::string& value) {
  return std::find(list.begin(), list.end(), value) != list.end();
}

bool is_supported(const std::string& extension, bool textures) {
  return contains(kSupportedExtensions, extension) || extension.starts_with("KHR_materials_") ||
         (!textures && contains(kImageExtensions, extension));
}

}  // namespace

std::size_t component_size(ComponentType type) {
  switch (type) {
    case ComponentType::kInt8:
    case ComponentType::kUint8:
      return 1;
    case ComponentType::kInt16:
    case ComponentType::kUint16:
      return 2;
    default:
      return 4;
  }
}

Document parse_document(std::string_view json, const std::string& name) {
  return DocumentParser(parse_json(json, name, {.max_bytes = std::size_t{512} << 20, .max_depth = 256}), name).parse();
}

void require_supported(const Document& document, const std::string& name, bool textures) {
  for (const std::string& extension : document.extensions_required) {
    if (!is_supported(extension, textures))
      throw InputError(name, "needs the glTF extension " + extension + ", which is not supported");
  }
}

}  // namespace tileflight::tile_content::gltf
