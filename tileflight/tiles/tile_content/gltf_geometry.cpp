#include "tileflight/tiles/tile_content/gltf_geometry.h"

#include <draco/compression/decode.h>

#include <algorithm>
#include <cstring>
#include <memory>
#include <numeric>

#include "tileflight/core/base/input_error.h"

namespace tileflight::tile_content::gltf {
namespace {

using geometry::Triangle;

std::vector<Triangle> triangles_of_list(std::span<const std::uint32_t> corners) {
  std::vector<Triangle> triangles(corners.size() / 3);
  for (std::size_t i = 0; i < triangles.size(); ++i) {
    triangles[i] = {corners[3 * i], corners[3 * i + 1], corners[3 * i + 2]};
  }
  return triangles;
}

std::vector<Triangle> triangles_of_strip(std::span<const std::uint32_t> v) {
  std::vector<Triangle> triangles;
  for (std::size_t i = 0; i + 2 < v.size(); ++i) {
    const Triangle triangle = {v[i], v[i + 1 + i % 2], v[i + 2 - i % 2]};
    const bool stitch = triangle[0] == triangle[1] || triangle[1] == triangle[2] || triangle[2] == triangle[0];
    if (!stitch) triangles.push_back(triangle);
  }
  return triangles;
}

std::vector<Triangle> triangles_of_fan(std::span<const std::uint32_t> v) {
  std::vector<Triangle> triangles;
  for (std::size_t i = 1; i + 1 < v.size(); ++i) triangles.push_back({v[i], v[i + 1], v[0]});
  return triangles;
}

std::vector<std::uint32_t> corners_of(const Primitive& primitive, std::size_t vertex_count, Buffers& buffers) {
  if (primitive.indices) return buffers.indices(*primitive.indices);
  std::vector<std::uint32_t> corners(vertex_count);
  std::iota(corners.begin(), corners.end(), 0U);
  return corners;
}

void check_corners(const std::vector<Triangle>& triangles, std::size_t vertex_count, const std::string& name) {
  for (const Triangle& triangle : triangles) {
    for (const std::uint32_t corner : triangle) {
      if (corner >= vertex_count) {
        throw InputError(
            name, "a triangle refers to vertex " + std::to_string(corner) + " of " + std::to_string(vertex_count));
      }
    }
  }
}

void check_count(const std::vector<float>& values, std::size_t components, std::size_t vertex_count, const char* what,
                 const std::string& name) {
  if (values.empty() || values.size() == vertex_count * components) return;
  throw InputError(name, std::string(what) + " has " + std::to_string(values.size() / components) + " entries for " +
                             std::to_string(vertex_count) + " vertices");
}

/// Integers stand for 0 to 1 only if the accessor says so (glTF 2.0, section 3.7.2.1); some writers forget it.
void normalize_colors(const Accessor& accessor, Geometry& out) {
  if (accessor.normalized || (accessor.type != ComponentType::kUint8 && accessor.type != ComponentType::kUint16))
    return;
  if (std::none_of(out.colors.begin(), out.colors.end(), [](float value) { return value > 1.0F; })) return;
  const float range = accessor.type == ComponentType::kUint8 ? 255.0F : 65535.0F;
  for (float& value : out.colors) value /= range;
  out.warnings.emplace_back("integer vertex colours that are not declared as normalised are read as if they were");
}

/// Reads the attributes that the Draco mesh lacks, or all if there is no Draco mesh.
void read_attributes(Geometry& out, const Primitive& primitive, const Document& document, Buffers& buffers,
                     const GeometryRequest& request) {
  const auto find = [&](const std::string& attribute) {
    const auto it = primitive.attributes.find(attribute);
    return it == primitive.attributes.end() ? nullptr : &it->second;
  };
  if (const auto* accessor = find("POSITION"); accessor != nullptr && out.positions.empty()) {
    out.positions = buffers.floats(*accessor, 3);
  }
  const auto* uv = find("TEXCOORD_" + std::to_string(request.tex_coord_set));
  if (uv != nullptr && request.tex_coords && out.tex_coords.empty()) out.tex_coords = buffers.floats(*uv, 2);
  if (request.feature_coord_set && out.feature_coords.empty()) {
    const auto* coords = find("TEXCOORD_" + std::to_string(*request.feature_coord_set));
    if (coords != nullptr) out.feature_coords = buffers.floats(*coords, 2);
  }
  if (const auto* accessor = find("COLOR_0"); accessor != nullptr && out.colors.empty()) {
    out.color_components = document.accessors[*accessor].components == 3 ? 3 : 4;
    out.colors = buffers.floats(*accessor, out.color_components);
    normalize_colors(document.accessors[*accessor], out);
  }
  if (const auto* accessor = find(request.feature_attribute); accessor != nullptr && out.feature_ids.empty()) {
    out.feature_ids = buffers.ids(*accessor);
  }
}

}  // namespace

bool has_surface(const Primitive& primitive) { return primitive.mode >= 4; }
bool has_points(const Primitive& primitive) { return primitive.mode == 0; }

std::vector<Triangle> assemble_triangles(int mode, std::span<const std::uint32_t> corners) {
  if (mode == 5) return triangles_of_strip(corners);
  if (mode == 6) return triangles_of_fan(corners);
  return triangles_of_list(corners);
}

Geometry read_geometry(const Primitive& primitive, const Document& document, Buffers& buffers,
                       const GeometryRequest& request, const std::string& name) {
  Geometry out;
  if (primitive.draco) out = decode_draco(buffers.view(primitive.draco->view), primitive, document, request, name);
  read_attributes(out, primitive, document, buffers, request);
  if (!primitive.draco) {
    const std::vector<std::uint32_t> corners = corners_of(primitive, out.vertex_count(), buffers);
    if (primitive.mode == 4 && corners.size() % 3 != 0)
      out.warnings.push_back("an incomplete last triangle is left out");
    if (has_points(primitive)) {
      out.points = corners;
    } else {
      out.triangles = assemble_triangles(primitive.mode, corners);
    }
  }
  check_count(out.tex_coords, 2, out.vertex_count(), "TEXCOORD", name);
  check_count(out.feature_coords, 2, out.vertex_count(), "TEXCOORD", name);
  if (!out.colors.empty()) check_count(out.colors, out.color_components, out.vertex_count(), "COLOR_0", name);
  if (!out.feature_ids.empty() && out.feature_ids.size() != out.vertex_count()) {
    throw InputError(name, request.feature_attribute + " must have one entry for each vertex");
  }
  check_corners(out.triangles, out.vertex_count(), name);
  for (const std::uint32_t point : out.points) {
    if (point >= out.vertex_count()) throw InputError(name, "a point refers to vertex " + std::to_string(point));
  }
  return out;
}

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
  if (const auto it = primitive.attributes.find("COLOR_0"); it != primitive.attributes.end())
    normalize_colors(document.accessors[it->second], out);
  if (!request.feature_attribute.empty()) {
    const std::vector<float> ids = read(request.feature_attribute, 1);
    out.feature_ids.resize(ids.size());
    std::transform(ids.begin(), ids.end(), out.feature_ids.begin(), id_from_float);
  }
  out.triangles = faces_of(*mesh);
  return out;
}

}  // namespace tileflight::tile_content::gltf
