#pragma once

#include <cstddef>
#include <filesystem>
#include <functional>
#include <optional>

#include "tileflight/core/geometry/ply.h"

namespace tileflight::scoring {

/// The points of a map in its own frame, visited in blocks. A large binary PLY file is held in memory one block at a
/// time, any other map as a whole.
class MapPoints {
 public:
  /// `map`: an odometry folder or a cloud. A file of up to `most_in_memory` points is read once. Throws InputError as
  /// read_map() does.
  explicit MapPoints(const std::filesystem::path& map, std::size_t most_in_memory = kBlock);
  explicit MapPoints(geometry::PointCloud cloud) : cloud_(std::move(cloud)) {}

  std::size_t size() const { return file_ ? file_->size() : cloud_.size(); }

  /// `first`: number of the block's first point in the map.
  using Visit = std::function<void(std::size_t first, const geometry::PointCloud& block)>;
  /// Visits all points, in order. Throws InputError.
  void visit(const Visit& visit) const;

  /// The block of visit() that begins with a point. Throws InputError.
  geometry::PointCloud read_block(std::size_t first) const;

  static constexpr std::size_t kBlock = std::size_t{1} << 19;

 private:
  std::size_t block_ = kBlock;
  std::optional<geometry::PlyCloudBlocks> file_;
  geometry::PointCloud cloud_;
};

/// Returns the file of a map's points: map.ply of an odometry folder, else the map itself. Throws InputError if a
/// folder has none.
std::filesystem::path map_file(const std::filesystem::path& map);

}  // namespace tileflight::scoring
