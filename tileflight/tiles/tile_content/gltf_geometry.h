#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "tileflight/core/geometry/mesh.h"
#include "tileflight/tiles/tile_content/gltf_buffers.h"
#include "tileflight/tiles/tile_content/gltf_document.h"

namespace tileflight::tile_content::gltf {

/// Surface or points of a primitive in its mesh's own frame.
struct Geometry {
  std::vector<float> positions;            ///< x y z, interleaved
  std::vector<float> tex_coords;           ///< u v, before any texture transform; empty: none (or not requested)
  std::vector<float> colors;               ///< color_components per vertex, 0..1; empty: none
  std::size_t color_components = 0;        ///< 3 or 4
  std::vector<std::uint32_t> feature_ids;  ///< one per vertex; empty: none
  std::vector<float> feature_coords;       ///< u v of a feature texture, untransformed; empty: none (or not requested)
  std::vector<geometry::Triangle> triangles;
  std::vector<std::uint32_t> points;  ///< vertex indices of point primitives (mode 0)
  std::vector<std::string> warnings;

  std::size_t vertex_count() const { return positions.size() / 3; }
};

/// Attributes to read besides positions and triangles.
struct GeometryRequest {
  bool tex_coords = true;
  std::size_t tex_coord_set = 0;                      ///< n of TEXCOORD_n
  std::string feature_attribute = {};                 ///< attribute with feature ids; empty: none
  std::optional<std::size_t> feature_coord_set = {};  ///< n of the TEXCOORD_n of a feature texture
};

/// Returns whether the primitive consists of triangles (not points or lines).
bool has_surface(const Primitive& primitive);
/// Returns whether the primitive consists of points.
bool has_points(const Primitive& primitive);

/// Reads a primitive of points, triangles, strip or fan, uncompressed or Draco. All indices are valid. Throws
/// InputError.
Geometry read_geometry(const Primitive& primitive, const Document& document, Buffers& buffers,
                       const GeometryRequest& request, const std::string& name);

/// Decodes a Draco mesh (KHR_draco_mesh_compression). Attributes that it lacks are left empty.
Geometry decode_draco(std::span<const std::byte> bytes, const Primitive& primitive, const Document& document,
                      const GeometryRequest& request, const std::string& name);

/// Assembles the triangles of a mode (4 list, 5 strip, 6 fan; glTF 2.0, section 3.7.2.1) from a list of vertex indices.
/// Degenerate stitching triangles of strips and an incomplete last triangle of a list are dropped.
std::vector<geometry::Triangle> assemble_triangles(int mode, std::span<const std::uint32_t> corners);

}  // namespace tileflight::tile_content::gltf
