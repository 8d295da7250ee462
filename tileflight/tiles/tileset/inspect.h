#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "tileflight/core/base/progress.h"
#include "tileflight/core/geometry/geodesy.h"
#include "tileflight/core/geometry/mesh.h"
#include "tileflight/tiles/fetch/open_source.h"
#include "tileflight/tiles/tileset/content_sample.h"

namespace tileflight::tileset {

/// Number of tiles, and minimum and maximum geometric error, of one level of the tree.
struct LevelSummary {
  std::int64_t tiles = 0;
  double geometric_error_min_m = 0.0;
  double geometric_error_max_m = 0.0;
};

/// Summary of a tileset from its JSON; external tilesets and subtrees are followed. A few contents are read for
/// attributions and for what they hold.
struct TilesetSummary {
  std::string version;
  std::string generator;
  std::int64_t tiles = 0;
  std::int64_t tiles_with_content = 0;
  std::int64_t leaves = 0;
  std::int64_t tiles_replace = 0;  ///< tiles with children, by their refine
  std::int64_t tiles_add = 0;
  std::int64_t tiles_unsupported = 0;            ///< unknown bounding volumes
  std::int64_t subtrees = 0;                     ///< files of implicit tiling
  std::map<std::string, std::int64_t> contents;  ///< references by kind: "b3dm", "glb", …, "tileset", "unknown"
  std::int64_t content_files = 0;                ///< distinct URIs, external tilesets not counted
  std::int64_t content_files_missing = 0;        ///< among those, if the source knows
  bool content_sizes_known = true;               ///< false: the source does not know sizes without fetching each file
  std::int64_t content_bytes = 0;                ///< size of the existing files
  std::int64_t external_tilesets = 0;            ///< distinct
  std::vector<LevelSummary> levels;              ///< 0 is the root; external tilesets continue from the referring tile
  std::optional<double> geometric_error_m;       ///< error of the whole tileset, as stated in its file
  std::vector<std::string> extensions_used;      ///< distinct, over all files
  std::vector<std::string> extensions_required;
  std::vector<std::string> extensions_unsupported;  ///< required extensions that are not supported
  bool georeferenced = false;
  std::optional<geometry::Geodetic> center;  ///< centre of the root's bounding volume, if georeferenced
  geometry::Box3 bounds_local;               ///< root's volume in its own frame, or east-north-up at `center`, metres
  std::vector<std::string> attribution;      ///< from the tileset files and the contents read, most frequent first
  std::int64_t contents_read = 0;            ///< the first in the tree, and others spread evenly over it
  std::vector<std::string> failures;         ///< external tilesets that could not be read, one line each

  /// True if some external tilesets or subtrees were not opened. Then all numbers of tiles, contents, files and bytes
  /// above are estimates from those that were, except `external_tilesets` and `subtrees`: those opened.
  bool is_estimate = false;
  std::int64_t nested_files = 0;         ///< references to external tilesets and subtrees, in all files opened
  std::int64_t nested_files_opened = 0;  ///< among these
  double count_spread = 0.0;             ///< two relative standard errors of the estimates; infinite: unknown

  std::int64_t finest_contents = 0;     ///< references in the finest cut: what an extraction of everything reads
  std::int64_t finest_bytes = 0;        ///< size of their distinct files, if the source knows sizes
  std::vector<ContentMeasures> probes;  ///< measures of some contents of the finest cut
  std::vector<std::string> warnings;

  int depth() const { return static_cast<int>(levels.size()); }
};

/// Limits how much of a tree is visited.
struct InspectLimits {
  bool all = false;                     ///< everything is visited; else an evenly spread part beyond these numbers
  std::size_t max_nested_files = 1024;  ///< external tilesets and subtrees opened
  std::size_t max_tiles = std::size_t{500} << 10;
};

/// The warning about a place whose surfaces have neither textures nor vertex colours.
inline constexpr const char* kNoTextures =
    "the place has no textures: images shade each surface by its direction to sun and sky, and odometry finds edges "
    "alone, nothing inside a surface, so that it may lose track; `light` in the camera's file (or --degrade with it) "
    "sets another light, {model: baked} none";

/// Summarizes a tileset. Throws InputError if the root cannot be read; faults further down are listed in `failures`.
TilesetSummary inspect_tileset(fetch::TileSource& source, const InspectLimits& limits = {},
                               const Progress& progress = {});
/// Opens a SOURCE (open_source.h) and summarizes its tileset.
TilesetSummary inspect_tileset(const std::string& source, const fetch::SourceOptions& options = {},
                               const InspectLimits& limits = {}, const Progress& progress = {});

}  // namespace tileflight::tileset
