#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "tileflight/core/geometry/point_cloud.h"
#include "tileflight/core/imaging/textured_mesh.h"

namespace tileflight::tile_content {

/// Applies an affine transform to a mesh; a reflection reverses the winding (glTF 2.0, section 3.7.4).
void transform_mesh(const geometry::Mat4& T_target_source, imaging::TexturedMesh& mesh);

/// Applies an affine transform to points, and to their normals as surface normals.
void transform_cloud(const geometry::Mat4& T_target_source, geometry::PointCloud& cloud);

/// Limits for one untrusted content; each is checked before allocation.
struct ContentLimits {
  std::size_t max_vertices = std::size_t{1} << 26;            ///< all meshes together, counting each instance
  std::size_t max_triangles = std::size_t{1} << 26;           ///< all meshes together, counting each instance
  std::size_t max_points = std::size_t{1} << 26;              ///< in one point cloud
  std::size_t max_meshes = std::size_t{1} << 20;              ///< counting each instance
  std::size_t max_decompressed_bytes = std::size_t{1} << 30;  ///< meshopt views, zero-filled accessors
  std::int64_t max_texture_pixels = std::int64_t{1} << 27;    ///< in one image
  int max_nesting = 8;                                        ///< nesting depth of composites
};

/// The up axis of a glTF content; all but kY come from the legacy `asset.gltfUpAxis`.
enum class UpAxis { kX, kY, kZ };

/// Options for decoding a content. The readers receive URIs as written in the content, relative to it. External
/// resources are rejected if a reader is empty.
struct ContentOptions {
  bool textures = true;   ///< false: no images, no texture coordinates
  bool opacities = true;  ///< false: surfaces that blend become opaque (TexturedMesh::blends)
  UpAxis up_axis = UpAxis::kY;
  std::function<std::vector<std::byte>(const std::string& uri)> read_resource = {};
  std::function<std::shared_ptr<const imaging::RgbImage>(const std::string& uri)> read_image = {};
  ContentLimits limits = {};
};

/// A content's triangles and points in its tile's frame (z up; before the tile's transform).
struct DecodedContent {
  std::vector<imaging::TexturedMesh> meshes;  ///< one per node, primitive and instance, in the scene's order
  std::vector<geometry::PointCloud> clouds;   ///< points without surface; "feature_id" is one of their scalars
  std::vector<std::string> copyrights;        ///< asset.copyright of each glTF
  std::vector<std::string> warnings;          ///< distinct
};

/// Decodes b3dm, i3dm, pnts, cmpt, glb and gltf (3D Tiles 1.1, "Tile formats"), detected by the first bytes. `name` is
/// used in messages. Throws InputError (name, cause): truncated, malformed, not a tile, or using an unsupported
/// feature.
DecodedContent decode_content(std::span<const std::byte> bytes, const std::string& name,
                              const ContentOptions& options = {});

/// Detects the format by the first bytes: "b3dm", "glb", "gltf", …; "HTML", "gzip" or "unknown" for data that is not a
/// tile.
std::string detect_content_format(std::span<const std::byte> bytes);

}  // namespace tileflight::tile_content
