#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>

#include "tileflight/geometry/input_error.h"
#include "tileflight/imaging/image.h"
#include "tileflight/tiles/tile_source.h"

namespace tileflight::tiles {

/// Images that several contents name: each is read and decoded once, by whoever asks first; the others wait for it.
/// Safe from several threads at once.
class SharedImages {
 public:
  explicit SharedImages(TileSource& source) : source_(source) {}

  /// Throws InputError, the same to everybody who asks for that URI.
  std::shared_ptr<const imaging::RgbImage> read(const std::string& uri, std::int64_t max_pixels);

 private:
  struct Entry {
    std::mutex mutex;
    bool tried = false;
    std::shared_ptr<const imaging::RgbImage> image;
    std::optional<InputError> failure;
  };

  std::shared_ptr<Entry> entry(const std::string& uri);

  TileSource& source_;
  std::mutex mutex_;
  std::map<std::string, std::shared_ptr<Entry>> entries_;
};

}  // namespace tileflight::tiles
