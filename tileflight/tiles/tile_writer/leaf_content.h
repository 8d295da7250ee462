#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include "tileflight/core/imaging/textured_mesh.h"
#include "tileflight/tiles/mesh_files/texel_store.h"
#include "tileflight/tiles/simplification/painted_surface.h"

namespace tileflight::tile_writer {

/// Measurements of a source that determine the tree of its tiles.
class LeafMeasures {
 public:
  /// Takes the limits of a tile. `max_atlas_px`: longest side of its texture.
  LeafMeasures(int tile_triangles, int max_atlas_px);

  /// Adds a triangle. Returns the share of a leaf that it fills. `texels`: its area in its texture; nullopt: no
  /// texture.
  float add(double area_m2, const std::optional<double>& texels);

  std::int64_t triangles() const { return triangles_; }
  /// Returns the texels of all triangles.
  double texels() const { return texels_; }
  /// Returns the edge of a typical texel of the source.
  double texel_m() const;
  /// Returns the levels below the root: those requested, or as many as the leaves require, at most 9.
  int depth(const std::optional<int>& levels) const;

 private:
  double tile_triangles_, atlas_texels_;
  std::int64_t triangles_ = 0;
  double weight_ = 0.0, area_m2_ = 0.0, texels_ = 0.0;
};

/// Returns the texels that a triangle with these texture coordinates covers on an image of this size.
double texels_between(const std::array<Eigen::Vector2f, 3>& uv, int width_px, int height_px);

/// Content of a leaf tile: source geometry that is not simplified.
struct LeafContent {
  std::vector<imaging::TexturedMesh> meshes;  ///< textured meshes share one atlas
  double texture_scale = 1.0;                 ///< scale of the source's texels, limited by the atlas size
};

/// Extracts the triangles with these numbers (ascending), unchanged, and copies the parts of the textures that they use
/// to a new atlas of at most `max_atlas_px` texels a side: triangles that share vertices stay together, in a window of
/// texels copied from the source. `fetch` reads them.
LeafContent build_leaf_content(const std::vector<imaging::TexturedMesh>& meshes,
                               const simplification::TriangleNumbering& numbers,
                               const std::vector<std::uint32_t>& triangles, int max_atlas_px,
                               const mesh_files::TexelFetcher& fetch = mesh_files::fetch_from_memory());

}  // namespace tileflight::tile_writer
