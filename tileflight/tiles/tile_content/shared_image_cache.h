#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>

#include "tileflight/core/base/input_error.h"
#include "tileflight/core/imaging/image.h"
#include "tileflight/tiles/fetch/tile_source.h"

namespace tileflight::tile_content {

/// Reads and decodes images that several contents share. The first thread that requests an image reads it; others wait.
/// Thread safe.
class SharedImageCache {
 public:
  explicit SharedImageCache(fetch::TileSource& source) : source_(source) {}

  /// Returns an image. Throws InputError, the same one for every request of that URI.
  std::shared_ptr<const imaging::RgbImage> read(const std::string& uri, std::int64_t max_pixels);

 private:
  struct Entry {
    std::mutex mutex;
    bool tried = false;
    std::shared_ptr<const imaging::RgbImage> image;
    std::optional<InputError> failure;
  };

  std::shared_ptr<Entry> entry(const std::string& uri);

  fetch::TileSource& source_;
  std::mutex mutex_;
  std::map<std::string, std::shared_ptr<Entry>> entries_;
};

}  // namespace tileflight::tile_content
