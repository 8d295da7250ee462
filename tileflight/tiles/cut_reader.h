#pragma once

#include <cstdint>
#include <limits>
#include <string>
#include <vector>

#include "tileflight/geometry/point_cloud.h"
#include "tileflight/geometry/progress.h"
#include "tileflight/imaging/textured_mesh.h"
#include "tileflight/tiles/selection.h"

namespace tileflight::tiles {

/// What became of a content of a cut.
struct ReadContent {
  std::vector<imaging::TexturedMesh> meshes;  ///< in the local frame
  std::vector<geometry::PointCloud> clouds;   ///< likewise
  std::vector<std::string> copyrights;
  std::vector<std::string> warnings;
  std::string failure;     ///< empty: none
  std::int64_t bytes = 0;  ///< of its file, as it is fetched
};

/// What a mesh takes, and the trees that rays through it need, without its texture.
std::uintmax_t memory_bytes(const imaging::TexturedMesh& mesh);

/// Reads the contents of a cut, each file once, in parallel; what comes back stands in the cut's order whatever the
/// threads do. A file that cannot be read is a failure of its contents, not an exception. Where meshes (memory_bytes),
/// their textures and points take more than `max_memory_bytes` together, reading stops and nothing comes back.
std::vector<ReadContent> read_cut(TileSource& source, const TilesetTree& tree, const TileCut& cut,
                                  const geometry::SE3& T_local_tileset, bool textures, const Progress& progress = {},
                                  std::uintmax_t max_memory_bytes = std::numeric_limits<std::uintmax_t>::max());

}  // namespace tileflight::tiles
