#pragma once

#include <filesystem>
#include <mutex>
#include <string>
#include <vector>

#include "tileflight/tiles/tile_writer/mesh_tileset.h"

namespace tileflight::tile_writer {

/// A tile of a tree of cells that has been written.
struct WrittenTile {
  std::string uri;         ///< empty: the tile has no content
  geometry::Box3 content;  ///< exact bounds of the content
  std::int64_t bytes = 0, triangles = 0, texels = 0;
};

/// The tiles of a tree of cells (CellTree) on their way to disk, level by level, and their tileset.json in the end.
class TileLevels {
 public:
  /// Makes the folders. `depth`: levels below the root.
  TileLevels(std::filesystem::path folder, const MeshTilesetOptions& options, int depth, const Progress& progress);

  int depth() const { return static_cast<int>(tiles_.size()) - 1; }
  const MeshTilesetOptions& options() const { return options_; }

  /// Writes the content of a cell. Different cells may be written at the same time.
  void write_tile(int level, std::size_t cell, const std::vector<imaging::TexturedMesh>& content);

  /// Counts a finished cell, with content or without.
  void advance(std::string_view what);
  void report(std::string_view what) const { report_progress(progress_, done_, total_, what); }

  /// Figures of a level; geometric_error_m and texel_m are for the caller to set, the rest is counted by finish().
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

}  // namespace tileflight::tile_writer
