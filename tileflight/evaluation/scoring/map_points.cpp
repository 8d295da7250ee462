#include "tileflight/evaluation/scoring/map_points.h"

#include <algorithm>
#include <utility>

#include "tileflight/core/base/input_error.h"
#include "tileflight/evaluation/scoring/map_inputs.h"

namespace tileflight::scoring {
namespace fs = std::filesystem;

MapPoints::MapPoints(const fs::path& map, std::size_t most_in_memory) : block_(most_in_memory) {
  file_ = geometry::PlyCloudBlocks::open(map_file(map));
  if (file_ && file_->size() > most_in_memory) return;
  file_.reset();
  cloud_ = read_map(map);
}

void MapPoints::visit(const Visit& visit) const {
  if (!file_) return visit(0, cloud_);
  for (std::size_t first = 0; first < file_->size(); first += block_) visit(first, read_block(first));
}

geometry::PointCloud MapPoints::read_block(std::size_t first) const {
  return file_ ? file_->read(first, std::min(block_, file_->size() - first)) : cloud_;
}

fs::path map_file(const fs::path& map) {
  const fs::path file = fs::is_directory(map) ? map / "map.ply" : map;
  if (fs::is_directory(map) && !fs::exists(file))
    throw InputError(map.string(),
                     "contains no map.ply; give a folder written by `odometry`, or a cloud (.ply, .pcd, .xyz)");
  return file;
}

}  // namespace tileflight::scoring
