#include <draco/compression/decode.h>

#include <algorithm>
#include <cstring>
#include <memory>

#include "tileflight/core/base/input_error.h"
#include "tileflight/tiles/tile_content/gltf_geometry.h"

namespace tileflight::tile_content::gltf {
namespace {

/// The library bounds its allocations by the input, with one exception inside its entropy-coded stream, which cannot be
/// checked from here (1.5.5): a corrupt count of texture orientations costs up to 256 MiB and some ten seconds before
/// the mesh is rejected.
std::unique_ptr<draco::Mesh> decode_mesh(std::span<const std::byte> bytes, const std::string& name) {
  draco::DecoderBuffer buffer;
  buffer.Init(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  draco::Decoder decoder;
  auto result = decoder.DecodeMeshFromBuffer(&buffer);
  if (!result.ok()) {
    throw InputError(name, "the Draco mesh cannot be decoded: " + result.status().error_msg_string());
  }
  return std::move(result).value();
}

/// Scale of an integer attribute that the accessor declares as normalised but Draco does not.
float normalization(const draco::PointAttribute& attribute, const Accessor& accessor) {
  if (!accessor.normalized || attribute.normalized()) return 1.0F;
  switch (accessor.type) {
    case ComponentType::kInt8:
      return 1.0F / 127.0F;
    case ComponentType::kUint8:
      return 1.0F / 255.0F;
    case ComponentType::kInt16:
      return 1.0F / 32767.0F;
    case ComponentType::kUint16:
      return 1.0F / 65535.0F;
    default:
      return 1.0F;
  }
}

/// One attribute for every point of the mesh; empty if the primitive's Draco part lacks it.
std::vector<float> attribute_values(const draco::Mesh& mesh, const std::string& attribute, std::size_t components,
                                    const Primitive& primitive, const Document& document, const std::string& name) {
  const auto id = primitive.draco->attributes.find(attribute);
  if (id == primitive.draco->attributes.end()) return {};
  const draco::PointAttribute* values = mesh.GetAttributeByUniqueId(id->second);
  if (values == nullptr || static_cast<std::size_t>(values->num_components()) != components) {
    throw InputError(name, "the Draco mesh has no " + attribute + " of " + std::to_string(components) + " components");
  }
  const auto accessor = primitive.attributes.find(attribute);
  const float scale =
      accessor == primitive.attributes.end() ? 1.0F : normalization(*values, document.accessors[accessor->second]);
  std::vector<float> out(static_cast<std::size_t>(mesh.num_points()) * components);
  const bool plain = values->data_type() == draco::DT_FLOAT32;
  for (draco::PointIndex point(0); point < mesh.num_points(); ++point) {
    float* to = &out[point.value() * components];
    const draco::AttributeValueIndex index = values->mapped_index(point);
    if (index.value() >= values->size()) {
      throw InputError(name,
                       "the Draco attribute " + attribute + " has no value for point " + std::to_string(point.value()));
    }
    if (plain) {
      std::memcpy(to, values->GetAddress(index), components * sizeof(float));
    } else {
      values->ConvertValue<float>(index, static_cast<std::int8_t>(components), to);
    }
    for (std::size_t c = 0; c < components; ++c) to[c] *= scale;
  }
  return out;
}

std::vector<geometry::Triangle> faces_of(const draco::Mesh& mesh) {
  std::vector<geometry::Triangle> triangles(mesh.num_faces());
  for (draco::FaceIndex i(0); i < mesh.num_faces(); ++i) {
    const draco::Mesh::Face& face = mesh.face(i);
    triangles[i.value()] = {face[0].value(), face[1].value(), face[2].value()};
  }
  return triangles;
}

std::size_t color_components(const Primitive& primitive, const Document& document) {
  const auto accessor = primitive.attributes.find("COLOR_0");
  return accessor != primitive.attributes.end() && document.accessors[accessor->second].components == 3 ? 3 : 4;
}

}  // namespace

Geometry decode_draco(std::span<const std::byte> bytes, const Primitive& primitive, const Document& document,
                      const GeometryRequest& request, const std::string& name) {
  const std::unique_ptr<draco::Mesh> mesh = decode_mesh(bytes, name);
  const auto read = [&](const std::string& attribute, std::size_t components) {
    return attribute_values(*mesh, attribute, components, primitive, document, name);
  };
  Geometry out;
  out.positions = read("POSITION", 3);
  if (request.tex_coords) out.tex_coords = read("TEXCOORD_" + std::to_string(request.tex_coord_set), 2);
  if (request.feature_coord_set) {
    out.feature_coords = read("TEXCOORD_" + std::to_string(*request.feature_coord_set), 2);
  }
  out.color_components = color_components(primitive, document);
  out.colors = read("COLOR_0", out.color_components);
  if (!request.feature_attribute.empty()) {
    const std::vector<float> ids = read(request.feature_attribute, 1);
    out.feature_ids.resize(ids.size());
    std::transform(ids.begin(), ids.end(), out.feature_ids.begin(), id_from_float);
  }
  out.triangles = faces_of(*mesh);
  return out;
}

}  // namespace tileflight::tile_content::gltf
