#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "tileflight/geometry/output_folder.h"
#include "tileflight/geometry/progress.h"
#include "tileflight/imaging/textured_mesh.h"

namespace tileflight::tiling {

struct TilesetOptions {
  /// Allowed simplification of each level above the finest, from the root down, metres; their number sets the depth of
  /// the tree.
  std::vector<double> level_errors_m{1.2, 0.45, 0.15};
  int jpeg_quality = 85;
  std::string copyright;                      ///< attribution, in every glb
  std::optional<geometry::SE3> T_ecef_local;  ///< frame of the meshes; without: the tileset is not georeferenced
};

struct TilesetLevel {
  int tiles = 0;
  std::int64_t triangles = 0;
  std::int64_t texels = 0;
  double geometric_error_m = 0.0;  ///< measured: largest distance from the finest surface, both ways
  double texel_m = 0.0;            ///< typical edge of a texel; 0: not known, or no texture
};

struct TilesetSummary {
  std::vector<TilesetLevel> levels;  ///< from the root to the leaves
  std::int64_t bytes = 0;
};

/// What folders of tilesets that this stage wrote hold, where they were written before folders had a marker.
geometry::UnmarkedFolder unmarked_tileset();

/// Writes `folder`/tileset.json (3D Tiles 1.1, explicit tiling, REPLACE) and its glb tiles: a quadtree over the meshes'
/// extent, z up. A mesh is never cut: it lies whole in the leaf that holds the middle of its extent, so give meshes no
/// larger than leaves; the finest level is the meshes as they are. A coarser level is simplified as a whole (so its
/// tiles meet) and carries the textures, half as fine for each level, in one image a tile. Boxes are exact bounds of
/// content and children; a level's geometric error is measured, not assumed, and is the same for all of its tiles, so
/// that an error asked for gives a cut without cracks. Throws InputError when there is no triangle or a file cannot be
/// written.
TilesetSummary write_tileset(const std::filesystem::path& folder, const std::vector<imaging::TexturedMesh>& meshes,
                             const TilesetOptions& options, const Progress& progress = {});

}  // namespace tileflight::tiling
