#pragma once

#include <cstddef>
#include <cstdint>
#include <set>
#include <utility>
#include <vector>

#include "tileflight/capture/recording/flight_tiles.h"
#include "tileflight/core/imaging/textured_mesh.h"

namespace tileflight::recording {

/// Lists the distinct textures of meshes in the order of their first use.
std::vector<const imaging::RgbImage*> textures_of(const std::vector<imaging::TexturedMesh>& meshes);

/// Memory that a content takes, known once it has been decoded.
struct ContentMemory {
  struct Texture {
    std::size_t number = 0;  ///< in the content's file
    std::uintmax_t decoded_bytes = 0, rendered_bytes = 0;
  };

  std::uintmax_t decoded_bytes = 0;   ///< meshes as they are kept, without textures
  std::uintmax_t rendered_bytes = 0;  ///< meshes in a scene that is rendered, with its trees and shading
  std::vector<Texture> textures;
};

/// Measures the memory of decoded meshes.
ContentMemory memory_of(const std::vector<imaging::TexturedMesh>& meshes);

/// Memory of several contents together. A file that several contents refer to has its textures in memory once.
class MemorySum {
 public:
  /// Returns the bytes that add() would add. `file`: number of the content's file. Contents that are rendered must be
  /// added before those that are only kept.
  std::uintmax_t bytes_of(const ContentMemory& content, std::size_t file, bool is_rendered) const;
  void add(const ContentMemory& content, std::size_t file, bool is_rendered);
  std::uintmax_t bytes() const { return bytes_; }

 private:
  std::uintmax_t bytes_ = 0;
  std::set<std::pair<std::size_t, std::size_t>> textures_;  ///< file, and number in it
};

/// Throws MemoryLimitExceeded, which says how much memory is needed and what to change, if the tiles of one of these
/// frames do not fit into the limit. Memory is estimated from the files' sizes and a few contents that are read; a
/// frame near the limit is measured. A frame that passes may still turn out too large (PartLoader::load).
void require_frames_fit(FlightTiles& tiles, const std::vector<std::size_t>& frames, std::uintmax_t max_memory_bytes,
                        const Progress& progress);

}  // namespace tileflight::recording
