#pragma once

#include <cstdint>
#include <vector>

#include "tileflight/imaging/textured_mesh.h"

namespace tileflight::tiling {

/// All triangles of several meshes under one number each: those of mesh 0 first, then those of mesh 1, ….
class TriangleNumbers {
 public:
  explicit TriangleNumbers(const std::vector<imaging::TexturedMesh>& meshes);

  struct Place {
    std::size_t mesh = 0, triangle = 0;
  };

  std::uint32_t count() const { return first_.back(); }
  Place operator()(std::uint32_t number) const;

 private:
  std::vector<std::uint32_t> first_;  ///< of each mesh, and the count of all
};

/// What a tile shows of the source as it is.
struct LeafContent {
  std::vector<imaging::TexturedMesh> meshes;  ///< textured ones share one sheet
  double texture_scale = 1.0;                 ///< of the source's texels, so that the sheet is no larger than allowed
};

/// The triangles with these numbers (ascending), each exactly once and where it was, with the parts of the textures
/// that they use on one new sheet of at most `sheet_px` texels a side: triangles that share vertices keep lying
/// together, in a window of texels copied from the source.
LeafContent leaf_content(const std::vector<imaging::TexturedMesh>& meshes, const TriangleNumbers& numbers,
                         const std::vector<std::uint32_t>& triangles, int sheet_px);

}  // namespace tileflight::tiling
