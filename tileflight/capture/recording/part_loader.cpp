#include "tileflight/capture/recording/part_loader.h"

#include <tbb/global_control.h>
#include <tbb/task_arena.h>
#include <tbb/task_group.h>

#include <algorithm>
#include <atomic>
#include <iterator>
#include <limits>
#include <numeric>

#include "tileflight/core/base/formatted_text.h"
#include "tileflight/core/base/memory_budget.h"

namespace tileflight::recording {
namespace {

using imaging::TexturedMesh;

/// Share of the memory limit that a part of several frames may take; the rest is for what is read ahead, and for what
/// building a scene takes until it is done.
constexpr double kPartShare = 0.65;
constexpr double kBuildingShare = 0.15;
/// Number of images whose needs decide which contents are kept.
constexpr std::size_t kImagesAhead = 64;

}  // namespace

/// An arena of its own, so that a thread that waits for its part of a frame does not begin to read a tile. A program
/// with a single thread never reads ahead.
struct PartLoader::Background {
  tbb::task_arena arena;
  tbb::task_group group;
  std::atomic<bool> stops = false;

  template <class Work>
  void run(const Work& work) {
    stops = false;
    arena.execute([&] { group.run(work); });
  }
  /// Throws what the work threw.
  void stop() {
    stops = true;
    arena.execute([&] { group.wait(); });
  }
};

PartLoader::PartLoader(FlightTiles& tiles, std::vector<std::size_t> images, std::uintmax_t max_memory_bytes)
    : tiles_(tiles),
      images_(std::move(images)),
      max_memory_bytes_(max_memory_bytes),
      contents_(tiles.content_count()),
      background_(std::make_unique<Background>()) {
  std::map<std::string, std::size_t> files;
  for (std::size_t i = 0; i < contents_.size(); ++i)
    file_of_.push_back(files.emplace(tiles.content(i).uri, files.size()).first->second);
}

PartLoader::~PartLoader() {
  try {
    background_->stop();
  } catch (const std::exception&) {  // of a content that is needed no more
  }
}

PartLoader::Contents PartLoader::contents_at(const std::vector<std::size_t>& places, std::size_t group) const {
  Contents contents;
  for (const std::size_t place : places) contents.push_back(tiles_.contents_of_group(group)[place]);
  return contents;
}

PartLoader::Contents PartLoader::contents_for(std::size_t image) const {
  return contents_at(tiles_.places_for_frame(image), tiles_.groups().group_of_frame[image]);
}

FlightPart PartLoader::load(std::size_t begin, const Progress& progress) {
  std::vector<std::size_t> places;
  FlightPart part{begin, choose_images(begin, places, progress), {}};
  if (part.end == part.begin)
    throw tileset::MemoryLimitExceeded(
        tiles_.name(),
        base::formatted("the tiles of frame %zu need %.3g GB and more, with a memory limit of %.3g GB: raise the limit "
                        "(--memory) or request coarser tiles (--pixel-error, --error)",
                        images_[begin], 1e-9 * static_cast<double>(rendered_bytes(contents_for(images_[begin]))),
                        1e-9 * static_cast<double>(max_memory_bytes_)));
  part_ = contents_at(places, tiles_.groups().group_of_frame[images_[begin]]);
  make_room(part_, {part_.begin(), part_.end()}, part.end, bytes_for_building());
  part_meshes_.clear();
  for (const std::size_t i : part_) {
    Content& content = contents_[i];
    part_meshes_.push_back(content.meshes.size());
    std::move(content.meshes.begin(), content.meshes.end(), std::back_inserter(part.meshes));
    content.meshes.clear();
  }
  return part;
}

/// Fetches what the part needs, into memory and `places`. Returns the part's end; `begin` if its first image does not
/// fit.
std::size_t PartLoader::choose_images(std::size_t begin, std::vector<std::size_t>& places, const Progress& progress) {
  const std::vector<std::size_t>& group_of_frame = tiles_.groups().group_of_frame;
  const std::size_t group = group_of_frame[images_[begin]];
  if (tiles_.is_region() && fetch(tiles_.contents_of_group(group), begin, max_memory_bytes_, progress)) {
    places.resize(tiles_.contents_of_group(group).size());
    std::iota(places.begin(), places.end(), std::size_t{0});
    return images_.size();
  }
  const auto share = static_cast<std::uintmax_t>(kPartShare * static_cast<double>(max_memory_bytes_));
  std::size_t end = begin;
  for (; end < images_.size() && group_of_frame[images_[end]] == group; ++end) {
    const std::vector<std::size_t> added = tiles_.places_for_frame(images_[end]);
    std::vector<std::size_t> wanted;
    std::ranges::set_union(places, added, std::back_inserter(wanted));
    const bool is_new = wanted.size() > places.size();
    if (is_new && !fetch(contents_at(wanted, group), begin, end == begin ? max_memory_bytes_ : share, progress)) break;
    places = std::move(wanted);
  }
  return end;
}

/// Reads those of the contents that are not in memory. Returns false, with some of them read, if a scene of all would
/// take more than `limit_bytes`. `begin`: contents are needed from images()[begin] on.
bool PartLoader::fetch(const Contents& contents, std::size_t begin, std::uintmax_t limit_bytes,
                       const Progress& progress) {
  const std::set<std::size_t> kept(contents.begin(), contents.end());
  while (true) {
    if (rendered_bytes(contents) > limit_bytes) return false;
    const std::uintmax_t room = make_room({}, kept, begin, bytes_for_building());
    const Contents batch = next_batch(contents, room);
    if (batch.empty()) return true;
    const auto missing = std::ranges::count_if(contents, [&](std::size_t i) { return !contents_[i].is_decoded; });
    report_progress(progress, static_cast<std::int64_t>(contents.size()) - missing,
                    static_cast<std::int64_t>(contents.size()), "reading tiles");
    read(batch);
  }
}

void PartLoader::prefetch(std::size_t begin) {
  const std::size_t threads = tbb::global_control::active_value(tbb::global_control::max_allowed_parallelism);
  if (begin == images_.size() || threads < 2) return;
  background_->run([this, begin] { read_ahead(begin); });
}

void PartLoader::read_ahead(std::size_t begin) {
  std::set<std::size_t> kept;
  const std::size_t end = std::min(images_.size(), begin + kImagesAhead);
  for (std::size_t i = begin; i < end; ++i) {
    const Contents wanted = contents_for(images_[i]);
    kept.insert(wanted.begin(), wanted.end());
    while (true) {
      const std::uintmax_t reserved = bytes_for_building();
      const std::uintmax_t left = make_room(part_, kept, begin, reserved + mean_bytes());
      const std::uintmax_t free_bytes = left - std::min(left, reserved);
      const Contents batch = next_batch(wanted, free_bytes);
      if (background_->stops || (!batch.empty() && batch.size() * mean_bytes() > free_bytes)) return;
      if (batch.empty()) break;
      read(batch);
    }
  }
}

std::uintmax_t PartLoader::bytes_for_building() const {
  return static_cast<std::uintmax_t>(kBuildingShare * static_cast<double>(max_memory_bytes_));
}

/// Chooses the contents to read next: missing ones, as many as are likely to fit into a part of `room_bytes`, at least
/// one. Those of one file, which is decoded once, come together.
PartLoader::Contents PartLoader::next_batch(const Contents& contents, std::uintmax_t room_bytes) const {
  constexpr std::uintmax_t kFirst = 16, kMost = 128;
  Contents batch;
  for (const std::size_t i : contents) {
    if (!contents_[i].is_decoded) batch.push_back(i);
  }
  std::ranges::stable_sort(batch, {}, [this](std::size_t i) { return file_of_[i]; });
  const std::uintmax_t mean = mean_bytes();
  const std::uintmax_t count = mean == 0 ? kFirst : std::clamp<std::uintmax_t>(room_bytes / (8 * mean), 1, kMost);
  if (batch.size() > count) batch.resize(count);
  return batch;
}

void PartLoader::read(const Contents& batch) {
  std::vector<tileset::LoadedContent> loaded = tiles_.read(batch);
  for (std::size_t k = 0; k < batch.size(); ++k) {
    Content& content = contents_[batch[k]];
    content.meshes = std::move(loaded[k].meshes);
    content.is_decoded = true;
    share_textures(file_of_[batch[k]], content.meshes);
    if (content.memory) continue;
    content.memory = memory_of(content.meshes);
    MemorySum sum;
    sum.add(*content.memory, 0, false);
    known_bytes_ += sum.bytes();
    ++known_;
  }
}

/// Replaces textures by those of the same file that are in memory already.
void PartLoader::share_textures(std::size_t file, std::vector<TexturedMesh>& meshes) {
  const std::vector<const imaging::RgbImage*> own = textures_of(meshes);
  const auto share = [&](std::shared_ptr<const imaging::RgbImage>& image) {
    if (!image) return;
    const auto number = static_cast<std::size_t>(std::ranges::find(own, image.get()) - own.begin());
    std::weak_ptr<const imaging::RgbImage>& known = textures_[{file, number}];
    if (auto texture = known.lock()) {
      image = std::move(texture);
    } else {
      known = image;
    }
  };
  for (TexturedMesh& mesh : meshes) {
    share(mesh.texture);
    share(mesh.opacity);
  }
}

/// Returns the memory of a scene of these contents, as far as they have been read.
std::uintmax_t PartLoader::rendered_bytes(const Contents& contents) const {
  MemorySum sum;
  for (const std::size_t i : contents) {
    if (contents_[i].memory) sum.add(*contents_[i].memory, file_of_[i], true);
  }
  return sum.bytes();
}

/// Releases contents, those that the images from images()[next] on need last first, until `rendered` (as a scene) and
/// the rest leave `room_bytes` of the limit; never those that are `kept`. Returns what is left of the limit.
std::uintmax_t PartLoader::make_room(const Contents& rendered, const std::set<std::size_t>& kept, std::size_t next,
                                     std::uintmax_t room_bytes) {
  MemorySum sum;
  std::set<std::size_t> counted(rendered.begin(), rendered.end());
  for (const std::size_t i : rendered) sum.add(*contents_[i].memory, file_of_[i], true);
  Contents others;
  for (std::size_t i = 0; i < contents_.size(); ++i) {
    if (!contents_[i].is_decoded || counted.contains(i)) continue;
    if (kept.contains(i)) {
      sum.add(*contents_[i].memory, file_of_[i], false);
    } else {
      others.push_back(i);
    }
  }
  MemorySum with_all = sum;
  for (const std::size_t i : others) with_all.add(*contents_[i].memory, file_of_[i], false);
  if (with_all.bytes() + room_bytes <= max_memory_bytes_) return max_memory_bytes_ - with_all.bytes();
  for (const std::size_t i : by_next_use(std::move(others), next)) {
    const ContentMemory& memory = *contents_[i].memory;
    if (sum.bytes() + sum.bytes_of(memory, file_of_[i], false) + room_bytes <= max_memory_bytes_) {
      sum.add(memory, file_of_[i], false);
    } else {
      contents_[i].meshes = {};
      contents_[i].is_decoded = false;
    }
  }
  return max_memory_bytes_ - std::min(max_memory_bytes_, sum.bytes());
}

/// Sorts contents by the order in which the images from images()[from] on need them; those that none of the next images
/// needs come last.
PartLoader::Contents PartLoader::by_next_use(Contents contents, std::size_t from) const {
  std::map<std::size_t, std::size_t> use;
  for (const std::size_t i : contents) use[i] = std::numeric_limits<std::size_t>::max();
  for (std::size_t k = from; k < std::min(images_.size(), from + kImagesAhead); ++k) {
    for (const std::size_t i : contents_for(images_[k])) {
      if (const auto at = use.find(i); at != use.end()) at->second = std::min(at->second, k);
    }
  }
  std::ranges::stable_sort(contents, {}, [&](std::size_t i) { return use[i]; });
  return contents;
}

void PartLoader::take_back(std::vector<TexturedMesh> meshes) {
  background_->stop();
  auto next = meshes.begin();
  for (std::size_t k = 0; k < part_.size(); ++k) {
    Content& content = contents_[part_[k]];
    const auto end = next + static_cast<std::ptrdiff_t>(part_meshes_[k]);
    content.meshes.assign(std::make_move_iterator(next), std::make_move_iterator(end));
    next = end;
  }
  part_.clear();
  // A scene leaves many free pages: over a long flight, the process would grow to 1.5 times what it has allocated.
  base::return_free_pages();
}

}  // namespace tileflight::recording
