#pragma once

#include <cstdint>
#include <limits>
#include <string>
#include <vector>

#include "tileflight/core/base/progress.h"
#include "tileflight/core/geometry/point_cloud.h"
#include "tileflight/core/imaging/textured_mesh.h"
#include "tileflight/tiles/tileset/selection.h"

namespace tileflight::tileset {

/// A content of a cut, loaded or failed.
struct LoadedContent {
  std::vector<imaging::TexturedMesh> meshes;  ///< in the local frame
  std::vector<geometry::PointCloud> clouds;   ///< in the local frame
  std::vector<std::string> copyrights;
  std::vector<std::string> warnings;
  std::string failure;     ///< empty: the content was loaded
  std::int64_t bytes = 0;  ///< file size as fetched
};

/// Returns the memory of a mesh and of the acceleration structures over it, without its texture.
std::uintmax_t memory_bytes(const imaging::TexturedMesh& mesh);

/// Reads the contents of a cut in parallel, each file once; the result is in the cut's order, independent of threads.
/// An unreadable file sets `failure` of its contents instead of throwing. If meshes (memory_bytes), textures and points
/// together exceed `max_memory_bytes`, reading stops and the result is empty.
std::vector<LoadedContent> read_cut(fetch::TileSource& source, const TilesetTree& tree, const TileCut& cut,
                                    const geometry::SE3& T_local_tileset, bool textures, const Progress& progress = {},
                                    std::uintmax_t max_memory_bytes = std::numeric_limits<std::uintmax_t>::max());

/// Tells whether surfaces have neither textures nor vertex colours, from a sample of a cut's contents that is spread
/// over it. False if none of them has a surface. A place with textures costs the reading of one content.
bool lacks_textures(fetch::TileSource& source, const TilesetTree& tree, const std::vector<CutContent>& contents,
                    const geometry::SE3& T_local_tileset);

}  // namespace tileflight::tileset
