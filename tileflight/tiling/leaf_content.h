#pragma once

#include <cstdint>
#include <vector>

#include "tileflight/imaging/textured_mesh.h"

namespace tileflight::tiling {

/// Consecutive numbers for all triangles of several meshes: those of mesh 0 first, then those of mesh 1, ….
class TriangleNumbering {
 public:
  explicit TriangleNumbering(const std::vector<imaging::TexturedMesh>& meshes);

  struct TriangleRef {
    std::size_t mesh = 0, triangle = 0;
  };

  TriangleRef operator()(std::uint32_t number) const;

 private:
  std::vector<std::uint32_t> first_;  ///< first number of each mesh, then the total count
};

/// Content of a leaf tile: unsimplified source geometry.
struct LeafContent {
  std::vector<imaging::TexturedMesh> meshes;  ///< textured ones share one atlas
  double texture_scale = 1.0;                 ///< relative to the source's texels, limited by the atlas size
};

/// Extracts the triangles with these numbers (ascending), unchanged, and copies the parts of the textures that they use
/// to a new atlas of at most `max_atlas_px` texels a side: triangles that share vertices stay together, in a window of
/// texels copied from the source.
LeafContent build_leaf_content(const std::vector<imaging::TexturedMesh>& meshes, const TriangleNumbering& numbers,
                               const std::vector<std::uint32_t>& triangles, int max_atlas_px);

}  // namespace tileflight::tiling
