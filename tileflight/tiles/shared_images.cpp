#include "tileflight/tiles/shared_images.h"

#include "tileflight/geometry/input_error.h"
#include "tileflight/tiles/ktx2.h"
#include "tileflight/tiles/uri.h"

namespace tileflight::tiles {

std::shared_ptr<SharedImages::Entry> SharedImages::entry(const std::string& uri) {
  const std::lock_guard lock(mutex_);
  std::shared_ptr<Entry>& entry = entries_[uri];
  if (!entry) entry = std::make_shared<Entry>();
  return entry;
}

std::shared_ptr<const imaging::RgbImage> SharedImages::read(const std::string& uri, std::int64_t max_pixels) {
  const std::shared_ptr<Entry> shared = entry(uri);
  const std::lock_guard lock(shared->mutex);
  if (!shared->tried) {
    shared->tried = true;
    try {
      const std::vector<std::byte> bytes = read_uri(source_, uri);
      shared->image =
          std::make_shared<const imaging::RgbImage>(decode_texture(bytes, uri_for_message(uri), max_pixels));
    } catch (const InputError& error) {
      shared->failure = error;
    }
  }
  if (shared->failure) throw *shared->failure;
  return shared->image;
}

}  // namespace tileflight::tiles
