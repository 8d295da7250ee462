#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "tileflight/core/base/progress.h"
#include "tileflight/core/imaging/textured_mesh.h"
#include "tileflight/tiles/tile_writer/tileset_writer.h"

namespace tileflight::tile_writer {

/// Options for writing a mesh as a tileset.
struct MeshTilesetOptions {
  int tile_triangles = 20000;  ///< approximate maximum per tile
  int max_atlas_px = 4096;     ///< longest side of a tile's texture
  std::optional<int> levels;   ///< levels including the root, 1 to 10; default: as many as the leaves require
  int jpeg_quality = 90;
  std::string copyright;                      ///< attribution, in every glb
  bool implicit = false;                      ///< an implicit quadtree with subtree files instead of an explicit tree
  bool meshopt = false;                       ///< geometry by EXT_meshopt_compression
  std::optional<geometry::SE3> T_ecef_local;  ///< frame of the meshes; nullopt: the tileset is not georeferenced
};

/// Figures of a written tileset.
struct MeshTilesetSummary {
  std::vector<TilesetLevel> levels;  ///< from the root to the leaves
  std::int64_t bytes = 0;
  double texture_scale = 1.0;  ///< smallest scale of the source's texels in a leaf; 1: full resolution everywhere
};

/// Writes a mesh as `folder`/tileset.json (3D Tiles 1.1, explicit tiling, REPLACE) and its glb tiles, z up.
///
/// Leaves hold the source's triangles, each exactly once and uncut, with copies of its texels. They come from a tree of
/// cells with four children each that balances triangles and texels, so all leaves have the same depth. Each level
/// above has a quarter of the triangles of the level below, simplified as a whole after borders that nearly meet have
/// been joined, so that its tiles meet without cracks, and texels of twice the size, painted from the level below. The
/// geometric error of a level is the largest distance between it and the source, measured both ways, or its texel size
/// if that is larger; leaves have 0. All tiles of a level have the same error, so that a requested error selects a cut
/// of one level.
///
/// Memory: the meshes with their textures, another third of the texels, and some 400 bytes a triangle. The output does
/// not depend on the number of threads. Throws InputError if there is no triangle or a file cannot be written.
MeshTilesetSummary write_mesh_tileset(const std::filesystem::path& folder,
                                      const std::vector<imaging::TexturedMesh>& meshes,
                                      const MeshTilesetOptions& options, const Progress& progress = {});

}  // namespace tileflight::tile_writer
