#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <map>
#include <memory>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "tileflight/core/geometry/transform.h"
#include "tileflight/core/imaging/textured_mesh.h"

namespace tileflight::tile_content {

/// The parts of a glTF 2.0 file (ISO/IEC 12113) that tiles need: the JSON, with all indices checked, but without buffer
/// access. Cameras, animations and skins are ignored, because scenes are static.
namespace gltf {

enum class ComponentType { kInt8, kUint8, kInt16, kUint16, kUint32, kFloat };

/// Returns the size of one component in bytes.
std::size_t component_size(ComponentType type);

struct Buffer {
  std::optional<std::string> uri;  ///< absent: the binary chunk of a GLB (or the fallback of a compressed view)
  std::size_t byte_length = 0;
};

/// EXT_meshopt_compression: the view's content in compressed form.
struct MeshoptView {
  std::size_t buffer = 0;
  std::size_t byte_offset = 0;
  std::size_t byte_length = 0;
  std::size_t byte_stride = 0;
  std::size_t count = 0;
  std::string mode;    ///< ATTRIBUTES, TRIANGLES, INDICES
  std::string filter;  ///< NONE, OCTAHEDRAL, QUATERNION, EXPONENTIAL
};

struct BufferView {
  std::size_t buffer = 0;
  std::size_t byte_offset = 0;
  std::size_t byte_length = 0;
  std::size_t byte_stride = 0;  ///< 0: elements are tightly packed
  std::optional<MeshoptView> meshopt;
};

struct SparseAccessor {
  std::size_t count = 0;
  std::size_t indices_view = 0;
  std::size_t indices_offset = 0;
  ComponentType indices_type = ComponentType::kUint32;
  std::size_t values_view = 0;
  std::size_t values_offset = 0;
};

struct Accessor {
  std::optional<std::size_t> view;  ///< absent: zeros (or Draco)
  std::size_t byte_offset = 0;
  ComponentType type = ComponentType::kFloat;
  std::size_t components = 1;  ///< SCALAR 1 to VEC4 4, matrices up to 16
  std::size_t count = 0;
  bool normalized = false;
  std::optional<SparseAccessor> sparse;
};

struct DracoPrimitive {
  std::size_t view = 0;
  std::map<std::string, std::uint32_t> attributes;  ///< attribute name to unique id inside the Draco mesh
};

/// EXT_mesh_features or EXT_instance_features: assigns vertices or instances to features.
struct FeatureIds {
  std::string attribute;                      ///< "_FEATURE_ID_0", "_BATCHID"; empty: the vertex or instance number
  std::optional<std::size_t> property_table;  ///< table of EXT_structural_metadata
  std::optional<std::uint32_t> null_id;       ///< id that means no feature
};

/// KHR_texture_transform: uv' = T R S uv.
struct TextureTransform {
  std::array<double, 2> offset{0, 0};
  double rotation_rad = 0;  ///< counter-clockwise in the image
  std::array<double, 2> scale{1, 1};
};

struct TextureReference {
  std::size_t texture = 0;
  std::size_t tex_coord = 0;  ///< n of TEXCOORD_n
  std::optional<TextureTransform> transform;
};

/// EXT_mesh_features: feature ids stored in a texture's channels.
struct TextureFeatureIds {
  TextureReference texture;
  std::vector<std::size_t> channels = {0};
  FeatureIds ids;  ///< property table and null id
};

struct Primitive {
  int mode = 4;  ///< 0 points, 1 to 3 lines, 4 triangles, 5 strip, 6 fan
  std::map<std::string, std::size_t> attributes;
  std::optional<std::size_t> indices;
  std::optional<std::size_t> material;
  std::optional<DracoPrimitive> draco;
  std::optional<FeatureIds> features;
  std::optional<TextureFeatureIds> texture_features;  ///< only if there are no per-vertex ids
};

struct Mesh {
  std::vector<Primitive> primitives;
};

/// How alpha decides what of a surface is there: all, what exceeds the cutoff, or a share of light.
enum class AlphaMode { kOpaque, kMask, kBlend };

struct Material {
  std::array<float, 4> base_color{1, 1, 1, 1};
  std::optional<TextureReference> base_color_texture;
  AlphaMode alpha_mode = AlphaMode::kOpaque;
  double alpha_cutoff = 0.5;
  std::vector<std::string> warnings;  ///< what of it is not shown
};

struct Texture {
  std::optional<std::size_t> image;  ///< a decodable image; nullopt: see `unsupported`
  std::string unsupported;           ///< unsupported extension that alone names the image
  imaging::Wrap wrap_u = imaging::Wrap::kRepeat;
  imaging::Wrap wrap_v = imaging::Wrap::kRepeat;
};

struct Image {
  std::optional<std::string> uri;
  std::optional<std::size_t> view;
};

/// EXT_mesh_gpu_instancing: one copy of the node's mesh per instance.
struct Instancing {
  std::optional<std::size_t> translation, rotation, scale;  ///< accessors
  std::optional<FeatureIds> features;
  std::optional<std::size_t> feature_ids;  ///< accessor of features->attribute
};

struct Node {
  geometry::Mat4 T_parent_node = geometry::Mat4::Identity();
  std::vector<std::size_t> children;
  std::optional<std::size_t> mesh;
  std::optional<Instancing> instancing;
};

struct Document {
  std::string copyright;
  std::vector<std::string> extensions_used;
  std::vector<std::string> extensions_required;
  geometry::Vec3 rtc_center = geometry::Vec3::Zero();  ///< CESIUM_RTC; z-up, added after the up-axis rotation
  std::vector<Buffer> buffers;
  std::vector<BufferView> views;
  std::vector<Accessor> accessors;
  std::vector<Mesh> meshes;
  std::vector<Material> materials;
  std::vector<Texture> textures;
  std::vector<Image> images;
  std::vector<Node> nodes;
  std::shared_ptr<const nlohmann::json> structural_metadata;  ///< EXT_structural_metadata, unparsed; may be null
  std::vector<std::size_t> roots;                             ///< nodes of the displayed scene
};

/// Parses the JSON of a glTF. `name` is used in messages. Throws InputError (name, part, cause): glTF 1.0, indices out
/// of range, wrong types. Required extensions are not checked here.
Document parse_document(std::string_view json, const std::string& name);

/// Throws InputError (name, extension) if a document requires an extension that is not supported. Extensions that only
/// affect images are allowed if `textures` is false.
void require_supported(const Document& document, const std::string& name, bool textures);

}  // namespace gltf
}  // namespace tileflight::tile_content
