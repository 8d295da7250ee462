#pragma once

#include <cstddef>
#include <map>
#include <string>
#include <vector>

namespace tileflight::tileset {

/// Numbers of a part of the tree. What was not opened is estimated, so that they are not whole.
struct TreeTally {
  double tiles = 0, with_content = 0, leaves = 0, replace = 0, add = 0, unsupported = 0, finest = 0;
  std::map<std::string, double> contents;
  std::vector<double> level_tiles;
  double files = 0, files_missing = 0, file_bytes = 0, finest_bytes = 0;  ///< of distinct files

  /// Adds another part that stands for `weight` like it; each of its files for `file_weight`.
  void add_part(const TreeTally& part, double weight, double file_weight) {
    tiles += weight * part.tiles;
    with_content += weight * part.with_content;
    leaves += weight * part.leaves;
    replace += weight * part.replace;
    add += weight * part.add;
    unsupported += weight * part.unsupported;
    finest += weight * part.finest;
    for (const auto& [kind, count] : part.contents) contents[kind] += weight * count;
    if (level_tiles.size() < part.level_tiles.size()) level_tiles.resize(part.level_tiles.size());
    for (std::size_t i = 0; i < part.level_tiles.size(); ++i) level_tiles[i] += weight * part.level_tiles[i];
    files += file_weight * part.files;
    files_missing += file_weight * part.files_missing;
    file_bytes += file_weight * part.file_bytes;
    finest_bytes += file_weight * part.finest_bytes;
  }
};

}  // namespace tileflight::tileset
