#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "tileflight/core/base/progress.h"
#include "tileflight/core/imaging/textured_mesh.h"

namespace tileflight::tile_writer {

/// Options for writing meshes that are tiles already.
struct TilesetOptions {
  /// Allowed simplification error of each level above the finest, from the root down, metres; their number sets the
  /// depth of the tree.
  std::vector<double> level_errors_m{1.2, 0.45, 0.15};
  int jpeg_quality = 85;
  std::string copyright;                      ///< attribution, in every glb
  std::optional<geometry::SE3> T_ecef_local;  ///< frame of the meshes; nullopt: the tileset is not georeferenced
};

/// Figures of one level.
struct TilesetLevel {
  int tiles = 0;
  std::int64_t triangles = 0;
  std::int64_t texels = 0;
  double geometric_error_m = 0.0;  ///< measured: largest distance from the finest surface, both ways
  double texel_m = 0.0;            ///< typical texel size; 0: unknown, or no texture
};

/// Figures of a written tileset.
struct TilesetSummary {
  std::vector<TilesetLevel> levels;  ///< from the root to the leaves
  std::int64_t bytes = 0;
};

/// Writes `folder`/tileset.json (3D Tiles 1.1, explicit tiling, REPLACE) and its glb tiles: a quadtree over the meshes'
/// extent, z up. Meshes are never cut: each lies entirely in the leaf that contains the centre of its extent, so meshes
/// should be no larger than leaves; the finest level holds the meshes unchanged. A coarser level is simplified as a
/// whole (so that its tiles meet) and carries the textures, at half the resolution per level, in one image a tile.
/// Boxes are exact bounds of content and children; a level's geometric error is measured, not assumed, and is the same
/// for all of its tiles, so that a requested error gives a cut without cracks. Throws InputError if there is no
/// triangle or a file cannot be written.
TilesetSummary write_tileset(const std::filesystem::path& folder, const std::vector<imaging::TexturedMesh>& meshes,
                             const TilesetOptions& options, const Progress& progress = {});

}  // namespace tileflight::tile_writer
