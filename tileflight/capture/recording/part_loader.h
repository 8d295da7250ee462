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

/// Consecutive views of frames of one group, all of the same sight, region and contents, with the meshes of all
/// contents that they need, in the order of the group's cut.
struct FlightPart {
  std::size_t begin = 0;  ///< index into PartLoader::views()
  std::size_t end = 0;    ///< likewise, not included
  std::vector<imaging::TexturedMesh> meshes;
  std::vector<std::uint32_t> places;  ///< of each mesh: its content's place in FlightTiles::contents_of_group
};

/// Loads the tiles of a flight part by part, within a memory limit: a part has as many views of frames as fit. A
/// content that the next part needs too is kept, not read again, and contents that later views need are read beside the
/// rendering of a part. How views are divided into parts changes no pixel. Not thread safe.
class PartLoader {
 public:
  /// `views`: those to load tiles for, in this order. `tiles` must outlive it, and nothing else may use it between
  /// prefetch() and take_back().
  PartLoader(FlightTiles& tiles, std::vector<FrameView> views, std::uintmax_t max_memory_bytes);
  ~PartLoader();
  PartLoader(const PartLoader&) = delete;
  PartLoader& operator=(const PartLoader&) = delete;

  const std::vector<FrameView>& views() const { return views_; }
  /// Takes other views, or another limit; what is in memory stays as far as the views need it and the limit allows. Not
  /// while a part is out.
  void set_views(std::vector<FrameView> views);
  void set_limit(std::uintmax_t max_memory_bytes) { max_memory_bytes_ = max_memory_bytes; }
  /// Of layers, other contents than these are left to other processes. `is_own`: by content.
  void set_own_contents(std::vector<bool> is_own);

  /// Loads the part that begins with view `begin` of views(); nullopt if that view alone does not fit. Throws
  /// InputError.
  std::optional<FlightPart> load(std::size_t begin, const Progress& progress = {});
  /// What a scene of a view takes, as far as its contents have been read, and an estimate of the others from their
  /// files' sizes.
  double estimated_bytes(const FrameView& view) const;
  /// Divides the contents that any of these images needs for this sight into layers, none of which is likely to take
  /// more in a scene (unless it is a single content), in the order of their numbers.
  std::vector<ContentRange> divide_contents(const std::vector<std::size_t>& images, Sight sight,
                                            double budget_bytes) const;
  /// Whether a view needs any content at all.
  bool needs_contents(const FrameView& view) const { return !contents_for(view).empty(); }
  /// Begins to read contents for views from `begin` on, as far as they fit beside the last part, while it is rendered.
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
  Contents contents_for(const FrameView& view) const;
  std::vector<std::size_t> places_for(const FrameView& view) const;
  double file_bytes(std::size_t content) const;
  double rendered_bytes_per_file_byte() const;
  std::size_t choose_views(std::size_t begin, std::vector<std::size_t>& places, const Progress& progress);
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
  std::vector<FrameView> views_;
  std::uintmax_t max_memory_bytes_;
  std::vector<Content> contents_;
  std::vector<std::size_t> file_of_;  ///< of each content: number of its file
  std::vector<bool> is_own_;          ///< set_own_contents(); empty: all are
  Contents part_;                     ///< contents of the last part
  std::vector<std::size_t> part_meshes_;
  std::uintmax_t known_bytes_ = 0, known_ = 0;  ///< of the contents read so far: decoded, and their number
  std::map<std::pair<std::size_t, std::size_t>, std::weak_ptr<const imaging::RgbImage>> textures_;
  std::unique_ptr<Background> background_;
  /// Places that whole images need, of which each layer takes its own; of the images of the views.
  mutable std::map<std::pair<std::size_t, Sight>, std::vector<std::size_t>> places_of_layers_;
};

}  // namespace tileflight::recording
