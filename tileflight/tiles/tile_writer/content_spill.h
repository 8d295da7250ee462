#pragma once

#include <cstdint>
#include <filesystem>
#include <vector>

#include "tileflight/core/imaging/textured_mesh.h"

namespace tileflight::tile_writer {

/// Keeps contents of tiles on disk until the levels above them are made, with positions in full precision and textures
/// as they were before compression.
class ContentSpill {
 public:
  /// Creates the folder.
  explicit ContentSpill(std::filesystem::path folder);

  /// Writes meshes, whose textures, if any, are one image.
  void write(int level, std::size_t cell, const std::vector<imaging::TexturedMesh>& content) const;
  /// Reads the content of a cell; empty if it has none. Without `textures`, the meshes have none.
  std::vector<imaging::TexturedMesh> read(int level, std::size_t cell, bool textures) const;
  void remove(int level, std::size_t cell) const;

 private:
  std::filesystem::path file_of(int level, std::size_t cell, const char* what) const;

  std::filesystem::path folder_;
};

}  // namespace tileflight::tile_writer
