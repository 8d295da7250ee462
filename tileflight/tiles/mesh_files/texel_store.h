#pragma once

#include <filesystem>
#include <functional>
#include <memory>
#include <unordered_map>

#include "tileflight/tiles/mesh_files/record_file.h"

namespace tileflight::mesh_files {

/// Returns texel (x, y) of an image, which may be a stand-in that has a size but no pixels.
using TexelFetcher = std::function<imaging::Rgb8(const imaging::RgbImage& image, int x, int y)>;

/// Returns a fetcher for images in memory.
inline TexelFetcher fetch_from_memory() {
  return [](const imaging::RgbImage& image, int x, int y) { return image(x, y); };
}

/// Stores decoded images on disk, in square blocks. Each image is decoded once. What is read of it is bounded by what
/// is drawn, however large it is and however its parts are spread over a place.
class TexelStore {
 public:
  explicit TexelStore(const std::filesystem::path& file) : file_(file) {}

  /// Stores an image and returns a stand-in for it: its size without pixels, valid as long as the store.
  std::shared_ptr<const imaging::RgbImage> add(const imaging::RgbImage& image);

  /// Returns a reader for texels of stand-ins, which has a cache of some 13 MB; each thread needs its own. The store
  /// must outlive it.
  TexelFetcher fetcher() const;

  std::uint64_t texels() const { return texels_; }

 private:
  ScratchFile file_;
  std::uint64_t end_ = 0, texels_ = 0;
  std::unordered_map<const imaging::RgbImage*, std::uint64_t> offset_of_;
  std::vector<std::shared_ptr<const imaging::RgbImage>> stand_ins_;
};

}  // namespace tileflight::mesh_files
