#pragma once

#include <cstdint>
#include <filesystem>
#include <vector>

#include "tileflight/core/imaging/textured_mesh.h"

namespace tileflight::tile_writer {

/// Contents of tiles on disk until the levels above them are made: positions in full, textures as they were before
/// compression.
class ContentSpill {
 public:
  /// Makes the folder.
  explicit ContentSpill(std::filesystem::path folder);

  /// Meshes whose textures, if any, are one image.
  void write(int level, std::size_t cell, const std::vector<imaging::TexturedMesh>& content) const;
  /// Empty if the cell has none. Without `textures`, meshes have none either.
  std::vector<imaging::TexturedMesh> read(int level, std::size_t cell, bool textures) const;
  void remove(int level, std::size_t cell) const;

 private:
  std::filesystem::path file_of(int level, std::size_t cell, const char* what) const;

  std::filesystem::path folder_;
};

}  // namespace tileflight::tile_writer
