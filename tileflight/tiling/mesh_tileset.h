#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "tileflight/geometry/progress.h"
#include "tileflight/imaging/textured_mesh.h"
#include "tileflight/tiling/tileset_writer.h"

namespace tileflight::tiling {

struct MeshTilesetOptions {
  int tile_triangles = 20000;  ///< a leaf has about as many, at most; so have the coarser tiles
  int sheet_px = 4096;         ///< longest side of a tile's texture
  std::optional<int> levels;   ///< of the tree, the root included, 1 to 10; without: as many as the leaves ask for
  int jpeg_quality = 90;
  std::string copyright;                      ///< attribution, in every glb
  std::optional<geometry::SE3> T_ecef_local;  ///< frame of the meshes; without: the tileset is not georeferenced
};

struct MeshTilesetSummary {
  std::vector<TilesetLevel> levels;  ///< from the root to the leaves
  std::int64_t bytes = 0;
  double texture_scale = 1.0;  ///< smallest scale at which a leaf keeps the source's texels; 1: all are as they were
};

/// Writes any mesh as `folder`/tileset.json (3D Tiles 1.1, explicit tiling, REPLACE) and its glb tiles, z up.
///
/// Leaves hold the source's triangles, each exactly once, uncut, with its texels copied. They come from a tree of cells
/// with four children each that shares triangles and texels out evenly, so all leaves are equally deep. Each level
/// above has a quarter of the triangles of the one below, simplified as a whole after borders that nearly meet have
/// been joined, so its tiles meet without cracks, and texels twice as long, painted from the level below. The geometric
/// error of a level is the largest distance between it and the source, measured both ways, or its texel's edge if that
/// is more; leaves have 0. It is the same for all tiles of a level, so that an error asked for gives a cut of one
/// level.
///
/// Memory: the meshes with their textures, one more third of the texels, and some 400 bytes a triangle. The same input
/// gives the same bytes for any number of threads. Throws InputError when there is no triangle or a file cannot be
/// written.
MeshTilesetSummary write_mesh_tileset(const std::filesystem::path& folder,
                                      const std::vector<imaging::TexturedMesh>& meshes,
                                      const MeshTilesetOptions& options, const Progress& progress = {});

}  // namespace tileflight::tiling
