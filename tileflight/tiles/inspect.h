#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "tileflight/geometry/geodesy.h"
#include "tileflight/geometry/mesh.h"
#include "tileflight/geometry/progress.h"
#include "tileflight/tiles/open_source.h"

namespace tileflight::tiles {

/// Least and largest geometric error of the tiles of one level of the tree.
struct LevelSummary {
  std::int64_t tiles = 0;
  double geometric_error_min_m = 0.0;
  double geometric_error_max_m = 0.0;
};

/// What a tileset holds, by its JSON: external tilesets and subtrees are followed. Of contents, a few are read for the
/// names of their holders.
struct TilesetSummary {
  std::string version;
  std::string generator;
  std::int64_t tiles = 0;
  std::int64_t tiles_with_content = 0;
  std::int64_t leaves = 0;
  std::int64_t tiles_replace = 0;  ///< refine of tiles that have children
  std::int64_t tiles_add = 0;
  std::int64_t tiles_unsupported = 0;            ///< unknown bounding volumes
  std::int64_t subtrees = 0;                     ///< files of implicit tiling
  std::map<std::string, std::int64_t> contents;  ///< references by kind: "b3dm", "glb", …, "tileset", "unknown"
  std::int64_t content_files = 0;                ///< distinct URIs, external tilesets not counted
  std::int64_t content_files_missing = 0;        ///< of those, where the source can tell
  bool content_sizes_known = true;               ///< false: the source cannot tell without fetching each
  std::int64_t content_bytes = 0;                ///< of those that are there
  std::int64_t external_tilesets = 0;            ///< distinct
  std::vector<LevelSummary> levels;          ///< 0 is the root; external trees count on from the tile that names them
  std::optional<double> geometric_error_m;   ///< of the whole tileset, as its file says
  std::vector<std::string> extensions_used;  ///< distinct, over all files
  std::vector<std::string> extensions_required;
  std::vector<std::string> extensions_unsupported;  ///< of those required
  bool georeferenced = false;
  std::optional<geometry::Geodetic> center;  ///< of the root's bounding volume, where georeferenced
  geometry::Box3 bounds_local;  ///< of the root's volume: its own frame, or east-north-up at `center`, metres
  std::vector<std::string>
      attribution;                    ///< of the tileset files and of the contents that were read, most frequent first
  std::int64_t contents_read = 0;     ///< the tree's first, and others evenly over it
  std::vector<std::string> failures;  ///< external tilesets that could not be read, one line each
  std::vector<std::string> warnings;

  int depth() const { return static_cast<int>(levels.size()); }
};

/// Throws InputError when the root cannot be read; what is broken further down stands in `failures`.
TilesetSummary inspect_tileset(TileSource& source, const Progress& progress = {});
/// `source`: as load_region takes it.
TilesetSummary inspect_tileset(const std::string& source, const SourceOptions& options = {},
                               const Progress& progress = {});

}  // namespace tileflight::tiles
