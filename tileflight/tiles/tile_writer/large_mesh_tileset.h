#pragma once

#include <cstdint>

#include "tileflight/tiles/mesh_files/mesh_spill.h"
#include "tileflight/tiles/tile_writer/mesh_tileset.h"

namespace tileflight::tile_writer {

/// Limits of what is in memory at a time. The tiles depend on all of these numbers except `threads`, and on nothing
/// else that differs from machine to machine.
struct LargeMeshLimits {
  std::size_t sample_triangles = std::size_t{1} << 21;  ///< triangles that decide the first splits of the tree
  std::size_t bucket_triangles = std::size_t{1} << 20;  ///< triangles that are sorted into leaves together
  std::uint64_t block_bytes = 900'000'000;              ///< contents whose coarser levels are made together
  int threads = 0;                                      ///< at most; 0: as many as there are; each takes some 150 MB
};

/// Writes a mesh on disk like write_mesh_tileset(), in some 2 GB of memory whatever its size.
///
/// 1. The triangles are measured; a sample of them gives the first splits of the tree, by which they are sorted into
///    buckets on disk, and each bucket is split further by its own triangles.
/// 2. Leaves are written bucket by bucket. They equal those of write_mesh_tileset() if the sample was all triangles.
/// 3. Coarser levels are made in blocks, as many cells as fit, two levels at a time, from contents kept on disk
///    (write_coarse_levels). Vertices that blocks share stay until the blocks are parts of one, so that tiles meet
///    across blocks on every level. Once a level fits as a whole, all above it are made from it, with nothing fixed.
///    Errors add up from step to step, so they are upper bounds.
///
/// Everything temporary is in `folder`/work, which is removed. The output does not depend on the number of threads.
/// Throws InputError: no triangle with an area, too little space on disk (before the work), a file cannot be written.
MeshTilesetSummary write_large_mesh_tileset(const std::filesystem::path& folder, mesh_files::MeshSpill& mesh,
                                            const MeshTilesetOptions& options, const LargeMeshLimits& limits = {},
                                            const Progress& progress = {});

/// Throws InputError unless the file system of `folder` has these free bytes. `what`: for the message.
void require_free_space(const std::filesystem::path& folder, std::uintmax_t bytes, const std::string& what);

}  // namespace tileflight::tile_writer
