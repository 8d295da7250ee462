#pragma once

#include <filesystem>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "tileflight/tiles/simplification/surface_simplification.h"
#include "tileflight/tiles/tile_writer/cell_tree.h"
#include "tileflight/tiles/tile_writer/mesh_tileset.h"

namespace tileflight::tile_writer {

/// A tile of a tree of cells that has been written.
struct WrittenTile {
  std::string uri;         ///< empty: the tile has no content
  geometry::Box3 content;  ///< exact bounds of the content
  std::int64_t bytes = 0, triangles = 0, texels = 0;
};

/// Writes the tiles of a tree of cells (CellTree) level by level, and their tileset.json in the end.
class TileLevels {
 public:
  /// Creates the folders. `depth`: levels below the root.
  TileLevels(std::filesystem::path folder, const MeshTilesetOptions& options, int depth, const Progress& progress);

  int depth() const { return static_cast<int>(tiles_.size()) - 1; }
  const MeshTilesetOptions& options() const { return options_; }

  /// Writes the content of a cell. Different cells may be written at the same time.
  void write_tile(int level, std::size_t cell, const std::vector<imaging::TexturedMesh>& content);

  /// Counts a finished cell, with content or without.
  void advance(std::string_view what);
  void report(std::string_view what) const { report_progress(progress_, done_, total_, what); }

  /// Returns the figures of a level. The caller sets geometric_error_m and texel_m; finish() counts the rest.
  TilesetLevel& level(int level) { return summary_.levels[static_cast<std::size_t>(level)]; }
  void set_texture_scale(double scale) { summary_.texture_scale = scale; }

  /// Writes tileset.json, and the subtrees of an implicit tiling.
  MeshTilesetSummary finish();

 private:
  std::filesystem::path folder_;
  const MeshTilesetOptions& options_;
  const Progress& progress_;
  std::vector<std::vector<WrittenTile>> tiles_;  ///< [level][cell]
  MeshTilesetSummary summary_;
  std::mutex mutex_;
  std::int64_t done_ = 0, total_ = 0;
};

/// The part of a tree below one cell, whose coarser levels are made together.
struct LevelBlock {
  std::uint32_t cell = 0;
  int level = 0;         ///< level of the cell
  int from_level = 0;    ///< level whose surface is given
  int to_level = 0;      ///< coarsest level to be made, at least `level`
  double texel_m = 0.0;  ///< edge of a typical texel of the source
  double error_m = 0.0;  ///< distance of the given surface from the source
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
                                             const simplification::FixedVertices& fixed,
                                             std::shared_ptr<const std::vector<imaging::TexturedMesh>> below,
                                             const CellTree& cells, TileLevels& tiles);

}  // namespace tileflight::tile_writer
