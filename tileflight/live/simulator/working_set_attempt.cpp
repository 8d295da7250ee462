// A WorkingSet makes a scene as follows: it selects, reads and prepares tiles, coarser ones where memory is short.
#include <tbb/parallel_for.h>

#include <algorithm>
#include <exception>
#include <map>

#include "tileflight/core/base/formatted_text.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/live/simulator/working_set.h"
#include "tileflight/tiles/fetch/terms.h"
#include "tileflight/tiles/tileset/content_records.h"
#include "tileflight/tiles/tileset/cut_reader.h"
#include "tileflight/world/place/place_reader.h"

namespace tileflight::simulator {
namespace {

using geometry::Box3;

constexpr std::size_t kMaxPinned = 32;
/// Files that are read at once, and those after which reading ahead lets others in: a tenth of a second's.
constexpr std::size_t kFilesNow = 64, kFilesAhead = 2, kDistantFilesAhead = 16;
/// Contents from which the memory for a cut is estimated.
constexpr std::size_t kSampledContents = 32;

/// A cut of these contents.
tileset::TileCut part_of(const tileset::TileCut& cut, std::span<const std::size_t> contents) {
  tileset::TileCut part;
  for (const std::size_t i : contents) part.contents.push_back(cut.contents[i]);
  return part;
}

/// Contents in groups of at most `files` files; those of one file are in one group, so that it is read once.
std::vector<std::vector<std::size_t>> batches_of(const tileset::TileCut& cut, const std::vector<std::size_t>& contents,
                                                 std::size_t files) {
  std::map<std::string, std::size_t> file_of;
  std::vector<std::vector<std::size_t>> batches;
  for (const std::size_t i : contents) {
    const std::size_t file = file_of.try_emplace(cut.contents[i].uri, file_of.size()).first->second;
    batches.resize(std::max(batches.size(), file / files + 1));
    batches[file / files].push_back(i);
  }
  return batches;
}

}  // namespace

/// A scene in the making.
struct WorkingSet::Attempt {
  SensorCells cells;
  DetailLimit wanted, detail;
  When when = When::kNow;
  std::uint64_t pins = 0;
  std::uint64_t number = 0;  ///< of all attempts

  tileset::TileCut cut;
  std::vector<ResidentTile> tiles;  ///< of the cut
  std::vector<std::size_t> missing;
  std::map<std::size_t, std::vector<imaging::TexturedMesh>> meshes;  ///< read, not yet a part; by tile
  std::vector<std::string> failures;
  std::uintmax_t bytes = 0;  ///< of all tiles whose size is known
  double worst_px = 0.0;
  std::shared_ptr<const ResidentScene> scene;  ///< the result

  Attempt(SensorCells around, const DetailLimit& began_at, const DetailLimit& limit, When made = When::kNow)
      : cells(std::move(around)), wanted(began_at), detail(limit), when(made) {}

  PreparedScene prepared() && { return {std::move(cells), wanted, detail, pins, worst_px, std::move(scene)}; }
};

/// Returns whether the cut fits into memory.
bool WorkingSet::load_whole_region(const Progress& progress) {
  Lock lock(loading_mutex_);
  Attempt attempt({}, scenes_.detail(), scenes_.detail());
  // An estimate is wrong by much less than this, so a place that fits is not refused.
  const tileset::TileCut cut = tileset::select_cut(*tree_, refinement_criterion({}, attempt.detail));
  if (cut.contents.size() > kSampledContents && estimate_bytes(cut, progress) > 3 * scene_limit_bytes()) return false;
  if (make(attempt, lock, progress) != Outcome::kMade) return false;
  enter(std::move(attempt).prepared());
  return true;
}

/// The scene for these cells, coarser if memory is short.
PreparedScene WorkingSet::load(const SensorCells& cells, Lock& lock, const Progress& progress) {
  const bool first = current() == nullptr;
  const DetailLimit wanted = scenes_.detail();
  DetailLimit detail = first ? first_detail(cells, progress) : wanted;
  while (true) {
    Attempt attempt(cells, wanted, detail);
    if (make(attempt, lock, progress) == Outcome::kMade) return std::move(attempt).prepared();
    if (!pinned_.empty()) {
      log_line(
          "the tiles that the sensors can see do not fit into memory: the oldest region of tfLoadRegion is unloaded");
      pinned_.erase(pinned_.begin());
      scenes_.count_pin_change();
      continue;
    }
    const std::optional<DetailLimit> coarser = detail.coarser();
    if (!coarser) {
      throw InputError(
          fetch::redact_source(options_.source),
          "even the coarsest tiles that the sensors can see take more than two thirds of the memory limit; raise "
          "it (--memory) or see less far (--view-distance)");
    }
    detail = *coarser;
  }
}

/// Selects and reads what the attempt's scene consists of. Throws InputError.
WorkingSet::Outcome WorkingSet::make(Attempt& attempt, Lock& lock, const Progress& progress) {
  attempt.number = ++attempts_;
  attempt.pins = scenes_.pins();
  attempt.cut = tileset::select_cut(*tree_, refinement_criterion(attempt.cells, attempt.detail));
  if (!volumes_are_checked_ && !attempt.cut.contents.empty()) {
    volumes_are_checked_ = true;
    if (tileset::widen_to_contents(*source_, *tree_, attempt.cut.contents, placement_.T_local_tileset))
      attempt.cut = tileset::select_cut(*tree_, refinement_criterion(attempt.cells, attempt.detail));
  }
  if (follows_sensors_) attempt.worst_px = largest_error_px(attempt.cut, attempt.cells);
  attempt.scene = scenes_.find_same(attempt.cut);
  if (attempt.scene) return Outcome::kMade;
  if (!take_known_tiles(attempt)) return Outcome::kTooLarge;
  const Outcome outcome = read_missing(attempt, lock, progress);
  if (outcome == Outcome::kMade) finish(attempt);
  return outcome;
}

/// Takes the tiles that are in memory; false if those whose size is known exceed the limit.
bool WorkingSet::take_known_tiles(Attempt& attempt) {
  const std::shared_ptr<const ResidentScene> before = current();
  attempt.failures = attempt.cut.failures;
  attempt.tiles.resize(attempt.cut.contents.size());
  std::vector<std::shared_ptr<const ResidentPart>> kept;
  for (std::size_t i = 0; i < attempt.tiles.size(); ++i) {
    ResidentTile& tile = attempt.tiles[i];
    tile.key = key_of(attempt.cut.contents[i]);
    tile.geometric_error_m = attempt.cut.contents[i].geometric_error_m;
    const auto known = known_tiles_.find(*tile.key);
    if (known != known_tiles_.end()) {
      attempt.bytes += known->second.bytes;
      tile.part = known->second.part.lock();
    }
    if (tile.part) {
      tile.mesh_count = tile.part->scene()->meshes().size();
      kept.push_back(tile.part);
    } else if (auto meshes = before && !follows_sensors_ ? before->copy_meshes(*tile.key) : std::nullopt) {
      attempt.meshes[i] = std::move(*meshes);
    } else {
      attempt.missing.push_back(i);
    }
  }
  preparing_ = std::move(kept);
  return attempt.bytes <= scene_limit_bytes();
}

WorkingSet::Outcome WorkingSet::read_missing(Attempt& attempt, Lock& lock, const Progress& progress) {
  const bool ahead = attempt.when == When::kAhead;
  const std::size_t files = !ahead ? kFilesNow : tree_->is_high_latency() ? kDistantFilesAhead : kFilesAhead;
  for (const auto& batch : batches_of(attempt.cut, attempt.missing, files)) {
    if (ahead && is_interrupted(attempt.cells)) return Outcome::kInterrupted;
    if (!read_batch(attempt, batch, progress)) return Outcome::kTooLarge;
    if (!follows_sensors_) continue;
    prepare_batch(attempt, batch, lock);
    if (attempt.number != attempts_) return Outcome::kInterrupted;  // another scene was made meanwhile
    if (!make_room(ahead ? &attempt : nullptr)) return Outcome::kNoRoom;
  }
  return Outcome::kMade;
}

/// False if the tiles exceed the memory limit. Tiles that cannot be read lose their key, so that the next scene
/// does not treat them as loaded.
bool WorkingSet::read_batch(Attempt& attempt, std::span<const std::size_t> batch, const Progress& progress) {
  // Its own count of the bytes differs a little from resident_bytes(), which decides.
  std::vector<tileset::LoadedContent> contents =
      tileset::read_cut(*source_, *tree_, part_of(attempt.cut, batch), placement_.T_local_tileset, true, progress,
                        2 * scene_limit_bytes());
  if (contents.size() < batch.size()) return false;
  for (std::size_t k = 0; k < batch.size(); ++k) {
    ResidentTile& tile = attempt.tiles[batch[k]];
    if (!contents[k].failure.empty()) {
      attempt.failures.push_back(contents[k].failure);
      tile.key.reset();
      continue;
    }
    ++tiles_read_;
    base::add_distinct(contents[k].copyrights, attribution_);
    const auto [known, is_new] = known_tiles_.try_emplace(*tile.key);
    if (is_new) attempt.bytes += known->second.bytes = resident_bytes(contents[k].meshes);
    attempt.meshes[batch[k]] = std::move(contents[k].meshes);
  }
  return attempt.bytes <= scene_limit_bytes();
}

/// Makes parts of the meshes. They are the attempt's own, so that others may read and select meanwhile.
void WorkingSet::prepare_batch(Attempt& attempt, std::span<const std::size_t> batch, Lock& lock) {
  if (attempt.when == When::kAhead) lock.unlock();
  tbb::parallel_for(std::size_t{0}, batch.size(), [&](std::size_t k) {
    const auto read = attempt.meshes.find(batch[k]);
    if (read == attempt.meshes.end()) return;
    ResidentTile& tile = attempt.tiles[batch[k]];
    tile.mesh_count = read->second.size();
    tile.part = std::make_shared<const ResidentPart>(std::move(read->second), *frame_);
  });
  attempt.meshes.clear();
  if (attempt.when == When::kAhead) lock.lock();
  if (attempt.number != attempts_) return;
  for (const std::size_t i : batch) {
    if (!attempt.tiles[i].part) continue;
    known_tiles_[*attempt.tiles[i].key].part = attempt.tiles[i].part;
    preparing_.push_back(attempt.tiles[i].part);
  }
}

void WorkingSet::finish(Attempt& attempt) {
  LoadedRegion loaded;
  loaded.tiles_wanted = static_cast<int>(attempt.cut.contents.size() + attempt.cut.failures.size());
  loaded.geometric_error_max = static_cast<float>(attempt.cut.geometric_error_max_m);
  loaded.failures = std::move(attempt.failures);
  loaded.bytes = attempt.bytes;
  loaded.tiles_failed = static_cast<int>(loaded.failures.size());
  loaded.tiles_loaded = loaded.tiles_wanted - loaded.tiles_failed;
  loaded.complete = loaded.tiles_failed == 0;
  for (const std::string& failure : loaded.failures) log_line(failure);
  if (!loaded.complete) scenes_.note_failure();
  ++scenes_built_;
  if (follows_sensors_) {
    attempt.scene = std::make_shared<const ResidentScene>(std::move(attempt.tiles), *frame_, std::move(loaded));
    preparing_.clear();
    return;
  }
  std::vector<imaging::TexturedMesh> all;
  for (auto& [tile, meshes] : attempt.meshes) {
    attempt.tiles[tile].mesh_count = meshes.size();
    std::ranges::move(meshes, std::back_inserter(all));
  }
  auto whole = std::make_shared<const ResidentPart>(place::with_placeholder(std::move(all)), *frame_);
  attempt.scene = std::make_shared<const ResidentScene>(std::move(attempt.tiles), std::move(whole), std::move(loaded));
}

/// Memory for a cut, from a sample of its contents.
std::uintmax_t WorkingSet::estimate_bytes(const tileset::TileCut& cut, const Progress& progress) {
  const std::size_t count = std::min(kSampledContents, cut.contents.size());
  std::vector<std::size_t> unknown;
  std::uintmax_t bytes = 0;
  std::size_t sampled = 0;
  for (std::size_t k = 0; k < count; ++k) {
    const std::size_t i = k * cut.contents.size() / count;
    const auto known = known_tiles_.find(*key_of(cut.contents[i]));
    if (known == known_tiles_.end()) {
      unknown.push_back(i);
    } else {
      bytes += known->second.bytes;
      ++sampled;
    }
  }
  const std::vector<tileset::LoadedContent> contents =
      tileset::read_cut(*source_, *tree_, part_of(cut, unknown), placement_.T_local_tileset, true, progress);
  for (std::size_t k = 0; k < contents.size(); ++k) {
    if (!contents[k].failure.empty()) continue;
    bytes += known_tiles_[*key_of(cut.contents[unknown[k]])].bytes = resident_bytes(contents[k].meshes);
    ++sampled;
  }
  return sampled == 0 ? 0 : bytes / sampled * cut.contents.size();
}

/// The detail at which to begin the search for one that fits: of the first scene, too large cuts are not read to find
/// that out, if a sample tells. (Later ones differ little from the one before.)
DetailLimit WorkingSet::first_detail(const SensorCells& cells, const Progress& progress) {
  DetailLimit detail = scenes_.detail();
  while (true) {
    const tileset::TileCut cut = tileset::select_cut(*tree_, refinement_criterion(cells, detail));
    if (cut.contents.size() <= kSampledContents || estimate_bytes(cut, progress) <= scene_limit_bytes() * 3 / 2)
      return detail;
    const std::optional<DetailLimit> coarser = detail.coarser();
    if (!coarser) return detail;
    detail = *coarser;
  }
}

/// Calls PreparedScenes::make_room() with the tiles of the scene in the making.
bool WorkingSet::make_room(const Attempt* ahead) {
  return scenes_.make_room(ahead == nullptr ? nullptr : &ahead->cells, preparing_, options_.max_memory_bytes);
}

/// Makes the scene of these cells unless others need the tree. What fails here is told when the cells are entered,
/// where it is tried again.
WorkingSet::Outcome WorkingSet::prepare_ahead(const SensorCells& cells) {
  try {
    Lock lock(loading_mutex_);
    if (scenes_.holds(cells)) return Outcome::kMade;
    if (is_interrupted(cells)) return Outcome::kInterrupted;
    const DetailLimit wanted = scenes_.detail();
    for (std::optional<DetailLimit> detail = wanted; detail; detail = detail->coarser()) {
      Attempt attempt(cells, wanted, *detail, When::kAhead);
      const Outcome outcome = make(attempt, lock, {});
      if (outcome == Outcome::kTooLarge && pinned_.empty()) continue;
      if (outcome != Outcome::kMade) return outcome;
      scenes_.add(std::move(attempt).prepared());
      make_room(nullptr);
      return Outcome::kMade;
    }
  } catch (const std::exception&) {
    const std::lock_guard lock(loading_mutex_);
    preparing_.clear();
  }
  return Outcome::kNoRoom;
}

LoadedRegion WorkingSet::add_region(const Box3& box_local, double error_m,
                                    std::span<const SensorViewpoint> viewpoints) {
  if (!tree_) return current()->loaded();
  const Waiting waiting(waiting_);
  Lock lock(loading_mutex_);
  const std::vector<PinnedRegion> before = pinned_;
  if (pinned_.size() >= kMaxPinned) pinned_.erase(pinned_.begin());
  pinned_.push_back({{box_local.center(), box_local.sizes(), {}}, error_m});
  scenes_.count_pin_change();
  Attempt attempt(follows_sensors_ ? cells_around(viewpoints) : SensorCells{}, scenes_.detail(), scenes_.detail());
  if (make(attempt, lock, {}) != Outcome::kMade) {
    pinned_ = before;
    scenes_.count_pin_change();
    throw InputError(fetch::redact_source(options_.source),
                     "the region needs more memory than is left: request a smaller region or coarser tiles");
  }
  enter(std::move(attempt).prepared());
  return current()->loaded();
}

}  // namespace tileflight::simulator
