#include "tileflight/tiles/tile_content/shared_image_cache.h"

#include "tileflight/core/imaging/ktx2.h"
#include "tileflight/tiles/fetch/uri.h"

namespace tileflight::tile_content {

std::shared_ptr<SharedImageCache::Entry> SharedImageCache::entry(const std::string& uri) {
  const std::lock_guard lock(mutex_);
  std::shared_ptr<Entry>& entry = entries_[uri];
  if (!entry) entry = std::make_shared<Entry>();
  return entry;
}

std::shared_ptr<const imaging::RgbImage> SharedImageCache::read(const std::string& uri, std::int64_t max_pixels) {
  const std::shared_ptr<Entry> shared = entry(uri);
  const std::lock_guard lock(shared->mutex);
  if (!shared->tried) {
    shared->tried = true;
    try {
      const std::vector<std::byte> bytes = fetch::read_uri(source_, uri);
      shared->image = std::make_shared<const imaging::RgbImage>(
          imaging::decode_texture(bytes, fetch::uri_for_message(uri), max_pixels));
    } catch (const InputError& error) {
      shared->failure = error;
    }
  }
  if (shared->failure) throw *shared->failure;
  return shared->image;
}

}  // namespace tileflight::tile_content
