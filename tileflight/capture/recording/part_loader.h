#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <utility>
#include <vector>

#include "tileflight/capture/recording/content_memory.h"
#include "tileflight/capture/recording/flight_tiles.h"

namespace tileflight::recording {

/// Consecutive images of one group, with the meshes of all contents that they need, in the order of the group's cut.
struct FlightPart {
  std::size_t begin = 0;  ///< index into PartLoader::images()
  std::size_t end = 0;    ///< likewise, not included
  std::vector<imaging::TexturedMesh> meshes;
};

/// Loads the tiles of a flight part by part, within a memory limit: a part has as many images as fit. A content that
/// the next part needs too is kept, not read again, and contents that later images need are read beside the rendering
/// of a part. How images are divided into parts changes no pixel. Not thread safe.
class PartLoader {
 public:
  /// `images`: the numbers (ImageOrder) of those to load tiles for, in this order. `tiles` must outlive it, and nothing
  /// else may use it between prefetch() and take_back().
  PartLoader(FlightTiles& tiles, std::vector<std::size_t> images, std::uintmax_t max_memory_bytes);
  ~PartLoader();
  PartLoader(const PartLoader&) = delete;
  PartLoader& operator=(const PartLoader&) = delete;

  const std::vector<std::size_t>& images() const { return images_; }

  /// Loads the part that begins with images()[begin]. Throws MemoryLimitExceeded if that image alone does not fit, and
  /// InputError for an unreadable content.
  FlightPart load(std::size_t begin, const Progress& progress = {});
  /// Begins to read contents for images()[begin] and those after it, as far as they fit beside the last part, while
  /// that is rendered.
  void prefetch(std::size_t begin);
  /// Takes the meshes of the last part back, once it is rendered. Throws InputError if a content that was read
  /// meanwhile is unreadable.
  void take_back(std::vector<imaging::TexturedMesh> meshes);

 private:
  struct Background;  ///< runs read_ahead()
  struct Content {
    bool is_decoded = false;
    std::vector<imaging::TexturedMesh> meshes;  ///< empty while the last part has them
    std::optional<ContentMemory> memory;        ///< known after the first reading
  };
  using Contents = std::vector<std::size_t>;

  Contents contents_at(const std::vector<std::size_t>& places, std::size_t group) const;
  Contents contents_for(std::size_t image) const;
  std::size_t choose_images(std::size_t begin, std::vector<std::size_t>& places, const Progress& progress);
  bool fetch(const Contents& contents, std::size_t begin, std::uintmax_t limit_bytes, const Progress& progress);
  void read_ahead(std::size_t begin);
  std::uintmax_t bytes_for_building() const;
  void read(const Contents& batch);
  void share_textures(std::size_t file, std::vector<imaging::TexturedMesh>& meshes);
  Contents next_batch(const Contents& contents, std::uintmax_t room_bytes) const;
  std::uintmax_t mean_bytes() const { return known_ == 0 ? 0 : known_bytes_ / known_; }
  std::uintmax_t rendered_bytes(const Contents& contents) const;
  std::uintmax_t make_room(const Contents& rendered, const std::set<std::size_t>& kept, std::size_t next,
                           std::uintmax_t room_bytes);
  Contents by_next_use(Contents contents, std::size_t from) const;

  FlightTiles& tiles_;
  std::vector<std::size_t> images_;
  std::uintmax_t max_memory_bytes_;
  std::vector<Content> contents_;
  std::vector<std::size_t> file_of_;  ///< of each content: number of its file
  Contents part_;                     ///< contents of the last part
  std::vector<std::size_t> part_meshes_;
  std::uintmax_t known_bytes_ = 0, known_ = 0;  ///< of the contents read so far: decoded, and their number
  std::map<std::pair<std::size_t, std::size_t>, std::weak_ptr<const imaging::RgbImage>> textures_;
  std::unique_ptr<Background> background_;
};

}  // namespace tileflight::recording
