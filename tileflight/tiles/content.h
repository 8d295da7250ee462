#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "tileflight/geometry/point_cloud.h"
#include "tileflight/imaging/textured_mesh.h"
#include "tileflight/tiles/tileset.h"

namespace tileflight::tiles {

/// What one content of unknown origin may grow to; each is checked before anything of that size is allocated.
struct ContentLimits {
  std::size_t max_vertices = std::size_t{1} << 26;            ///< all meshes together, each instance counted
  std::size_t max_triangles = std::size_t{1} << 26;           ///< likewise
  std::size_t max_points = std::size_t{1} << 26;              ///< of one point cloud
  std::size_t max_meshes = std::size_t{1} << 20;              ///< each instance counted
  std::size_t max_decompressed_bytes = std::size_t{1} << 30;  ///< meshopt views, zero-filled accessors
  std::int64_t max_texture_pixels = std::int64_t{1} << 27;    ///< one image
  int max_nesting = 8;                                        ///< composites inside each other
};

/// How a content is read. The readers take URIs as they stand in the content, relative to it; empty: what lies outside
/// of the content is refused.
struct ContentOptions {
  bool textures = true;  ///< false: no images, no texture coordinates
  UpAxis up_axis = UpAxis::kY;
  std::function<std::vector<std::byte>(const std::string& uri)> read_resource = {};
  std::function<std::shared_ptr<const imaging::RgbImage>(const std::string& uri)> read_image = {};
  ContentLimits limits = {};
};

/// A content's triangles and points in its tile's frame (z up; before the tile's transform).
struct DecodedContent {
  std::vector<imaging::TexturedMesh> meshes;  ///< one a node, primitive and instance, in the scene's order
  std::vector<geometry::PointCloud> clouds;   ///< points that carry no surface; "feature_id" is a scalar of theirs
  std::vector<std::string> copyrights;        ///< asset.copyright of each glTF
  std::vector<std::string> warnings;          ///< distinct
};

/// Reads b3dm, i3dm, pnts, cmpt, glb and gltf (3D Tiles 1.1, "Tile formats"), told apart by their first bytes. `name`
/// stands in messages. Throws InputError (name, cause): cut short, malformed, not a tile at all, or in need of what
/// this reader lacks.
DecodedContent decode_content(std::span<const std::byte> bytes, const std::string& name,
                              const ContentOptions& options = {});

/// "b3dm", "glb", "gltf", … by the first bytes; "HTML", "gzip" and "unknown" for what is no tile.
std::string content_kind(std::span<const std::byte> bytes);

}  // namespace tileflight::tiles
