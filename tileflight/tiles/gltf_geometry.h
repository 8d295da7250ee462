#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "tileflight/geometry/mesh.h"
#include "tileflight/tiles/gltf_buffers.h"
#include "tileflight/tiles/gltf_document.h"

namespace tileflight::tiles::gltf {

/// A primitive's surface, in its mesh's own frame.
struct Geometry {
  std::vector<float> positions;            ///< x y z, one after the other
  std::vector<float> tex_coords;           ///< u v, before any texture transform; empty: none (or not wanted)
  std::vector<float> colors;               ///< color_components a vertex, 0..1; empty: none
  std::size_t color_components = 0;        ///< 3 or 4
  std::vector<std::uint32_t> feature_ids;  ///< one a vertex; empty: none
  std::vector<float> feature_coords;  ///< u v of a feature texture, before any transform; empty: none (or not wanted)
  std::vector<geometry::Triangle> triangles;
  std::vector<std::uint32_t> points;  ///< vertices that stand alone (mode 0)
  std::vector<std::string> warnings;

  std::size_t vertex_count() const { return positions.size() / 3; }
};

/// What is wanted of a primitive beside positions and triangles.
struct GeometryRequest {
  bool tex_coords = true;
  std::size_t tex_coord_set = 0;                      ///< n of TEXCOORD_n
  std::string feature_attribute = {};                 ///< which carries feature ids; empty: none wanted
  std::optional<std::size_t> feature_coord_set = {};  ///< n of the TEXCOORD_n of a feature texture
};

/// Whether the primitive carries surface (points and lines do not).
bool has_surface(const Primitive& primitive);
bool has_points(const Primitive& primitive);

/// Reads a primitive of points, triangles, strip or fan, plain or Draco. All corners lie inside the vertices. Throws
/// InputError.
Geometry read_geometry(const Primitive& primitive, const Document& document, Buffers& buffers,
                       const GeometryRequest& request, const std::string& name);

/// A Draco mesh (KHR_draco_mesh_compression). Attributes that it does not carry are left empty.
Geometry decode_draco(std::span<const std::byte> bytes, const Primitive& primitive, const Document& document,
                      const GeometryRequest& request, const std::string& name);

/// Triangles of a mode (4 list, 5 strip, 6 fan; glTF 2.0, section 3.7.2.1) over a list of corners. Strips lose the
/// triangles of no area that only stitch them; a list loses an incomplete last triangle.
std::vector<geometry::Triangle> triangles_of(int mode, std::span<const std::uint32_t> corners);

}  // namespace tileflight::tiles::gltf
