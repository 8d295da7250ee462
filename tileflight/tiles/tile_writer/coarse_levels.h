#pragma once

#include <memory>
#include <vector>

#include "tileflight/tiles/tile_writer/surface_simplification.h"
#include "tileflight/tiles/tile_writer/cell_tree.h"
#include "tileflight/tiles/tile_writer/tile_levels.h"

namespace tileflight::tile_writer {

/// The part of a tree whose coarser levels are made together: what lies below one cell.
struct LevelBlock {
  std::uint32_t cell = 0;
  int level = 0;         ///< of the cell
  int from_level = 0;    ///< whose surface is given
  int to_level = 0;      ///< the coarsest to be made, at least `level`
  double texel_m = 0.0;  ///< edge of a typical texel of the source
  double error_m = 0.0;  ///< of the given surface from the source
};

/// The content of a cell.
struct CellContent {
  std::uint32_t cell = 0;
  imaging::TexturedMesh mesh;
};

/// Writes the tiles of a block from the second finest level up: each level is simplified as a whole to a quarter of the
/// triangles, so that its tiles meet, and painted from the level below with texels of twice the size.
///
/// `finest`: the surface of from_level, with vertices at equal places merged; `below`: its meshes, freed as soon as
/// they are painted from; `fixed`: vertices shared with other blocks, which stay as they are, so that blocks meet, too.
/// Raises errors and texel sizes of the levels in `tiles`. The error of a level is the largest distance between it and
/// the given surface within the block, measured both ways, or its texel size if that is larger, plus the error of the
/// given surface: never less than the distance from the source. Returns the contents of to_level.
std::vector<CellContent> write_coarse_levels(const LevelBlock& block, const geometry::TriangleMesh& finest,
                                             const tile_writer::FixedVertices& fixed,
                                             std::shared_ptr<const std::vector<imaging::TexturedMesh>> below,
                                             const CellTree& cells, TileLevels& tiles);

}  // namespace tileflight::tile_writer
