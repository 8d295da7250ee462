#include "tileflight/simulator/working_set.h"

#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <cmath>
#include <exception>
#include <iterator>
#include <limits>

#include "tileflight/base/input_error.h"
#include "tileflight/base/string_lists.h"
#include "tileflight/place/require_surface.h"
#include "tileflight/simulator/camera_settings.h"
#include "tileflight/tiles/cut_reader.h"
#include "tileflight/transport/open_source.h"
#include "tileflight/transport/terms.h"

namespace tileflight::simulator {
namespace {

using geometry::Box3;
using geometry::Vec3;

constexpr std::size_t kMaxPinned = 32;
constexpr double kMaxOriginDistance_m = 20e3;
constexpr double kMaxAnchoredExtent_m = 1e5;  ///< above it, sensors may be far from the centre of the place
constexpr double kMaxHeight_m = 2e4;          ///< vertical search range for surfaces
/// Files that are read at once, and those after which reading ahead lets others in: a tenth of a second's.
constexpr std::size_t kFilesNow = 64, kFilesAhead = 2, kDistantFilesAhead = 16;
constexpr std::chrono::milliseconds kWaitForOthers{1};
/// Contents from which the memory for a cut is estimated.
constexpr std::size_t kSampledContents = 32;

Box3 bounding_box(const std::vector<imaging::TexturedMesh>& meshes) {
  Box3 box;
  for (const imaging::TexturedMesh& mesh : meshes) {
    for (const Vec3& vertex : mesh.mesh.vertices) box.extend(vertex);
  }
  if (box.isEmpty()) box.extend(Vec3(Vec3::Zero()));
  return box;
}

/// Counts a waiting caller while it exists.
class Waiting {
 public:
  explicit Waiting(std::atomic<int>& count) : count_(count) { ++count_; }
  ~Waiting() { --count_; }
  Waiting(const Waiting&) = delete;
  Waiting& operator=(const Waiting&) = delete;

 private:
  std::atomic<int>& count_;
};

/// A cut of these contents.
tiles::TileCut part_of(const tiles::TileCut& cut, std::span<const std::size_t> contents) {
  tiles::TileCut part;
  for (const std::size_t i : contents) part.contents.push_back(cut.contents[i]);
  return part;
}

/// Contents in groups of at most `files` files; those of one file are in one group, so that it is read once.
std::vector<std::vector<std::size_t>> batches_of(const tiles::TileCut& cut, const std::vector<std::size_t>& contents,
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

  tiles::TileCut cut;
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

WorkingSet::WorkingSet(const SimulatorOptions& options, SimulatorLog log, const Progress& progress)
    : options_(options), log_(std::move(log)), error_px_(options.error_px), scenes_({options.error_px}) {
  if (!(options.error_px > 0.0)) throw InputError("error in pixels", "must be above 0");
  if (!(options.max_distance_m > 0.0)) throw InputError("viewing distance", "must be above 0");
  open(progress);
  choose_residency(progress);
  if (follows_sensors_ && options.prefetch)
    prefetcher_ = std::jthread([this](const std::stop_token& stop) { prefetch(stop); });
}

WorkingSet::WorkingSet(const SimulatorOptions& options, std::vector<imaging::TexturedMesh> meshes, SimulatorLog log)
    : options_(options), log_(std::move(log)), error_px_(options.error_px), scenes_({options.error_px}) {
  const Box3 box = bounding_box(meshes);
  placement_.region = {box.center(), box.sizes()};
  if (options.load.origin) placement_.local_frame.emplace(*options.load.origin);
  LoadedRegion loaded;
  loaded.complete = true;
  loaded.tiles_wanted = loaded.tiles_loaded = 1;
  loaded.bytes = resident_bytes(meshes);
  frame_.emplace(box.center());
  std::vector<ResidentTile> tiles{{{}, 0.0, meshes.size(), nullptr}};
  auto whole = std::make_shared<const ResidentPart>(place::with_placeholder(std::move(meshes)), *frame_);
  PreparedScene only;
  only.scene = std::make_shared<const ResidentScene>(std::move(tiles), std::move(whole), std::move(loaded));
  only.detail = scenes_.detail();
  scenes_.enter(std::move(only));
}

void WorkingSet::log_line(const std::string& line) const {
  if (log_) log_(line);
}

void WorkingSet::open(const Progress& progress) {
  const std::string name = transport::redact_source(options_.source);
  report_progress(progress, 0, 0, "reading the tileset");
  source_ = transport::open_source(options_.source, options_.load.source);
  transport::require_permitted(source_->terms(), transport::Use::kAnalyse, options_.load.source.terms_accepted, name);
  tree_ = std::make_unique<tiles::TilesetTree>(*source_);
  tiles::require_supported_extensions(tree_->tileset(tree_->root()), name);
}

/// A region that is requested or small is loaded completely, if it fits; otherwise tiles follow the sensors.
void WorkingSet::choose_residency(const Progress& progress) {
  const std::string name = transport::redact_source(options_.source);
  tiles::LoadOptions load = options_.load;
  const bool names_region = load.center || load.center_local || load.size || !load.areas.empty();
  follows_sensors_ = options_.residency == TileResidency::kFollow;
  if (!follows_sensors_) {
    try {
      placement_ = tiles::resolve_placement(*tree_, load, name);
    } catch (const InputError&) {
      if (names_region || options_.residency == TileResidency::kRegion) throw;
      follows_sensors_ = true;
    }
  }
  if (follows_sensors_) {
    load.flight.emplace();
    placement_ = tiles::resolve_placement(*tree_, load, name);
  }
  if (is_default_origin_elsewhere(name)) {
    warnings_.push_back(
        "OriginGeopoint is AirSim's default, which lies outside this place: the place's own origin is used");
    options_.load.origin.reset();
    return choose_residency(progress);
  }
  base::add_distinct(placement_.warnings, warnings_);
  frame_.emplace(anchor());
  if (follows_sensors_ || load_whole_region(progress)) return;
  if (options_.residency == TileResidency::kRegion) {
    throw InputError(name,
                     "the region needs more memory than the limit: request a smaller region (--size) or coarser tiles "
                     "(--error), raise the limit (--memory), or load only what the sensors see (--follow sensors)");
  }
  log_line("the region does not fit into memory: only tiles that the sensors can see are loaded");
  follows_sensors_ = true;
}

/// Whether the origin is AirSim's default although the georeferenced place is far from it. Throws InputError for
/// another distant origin.
bool WorkingSet::is_default_origin_elsewhere(const std::string& name) const {
  if (!options_.load.origin || !tiles::is_georeferenced(*tree_)) return false;
  const Box3 box = tiles::local_bounding_box(tree_->volume(tree_->root()), placement_.T_local_tileset);
  if (box.exteriorDistance(Vec3(0.0, 0.0, box.center().z())) < kMaxOriginDistance_m) return false;
  const geometry::Geodetic& origin = *options_.load.origin;
  if (std::abs(origin.latitude_deg - kDefaultOrigin.latitude_deg) < 1e-6 &&
      std::abs(origin.longitude_deg - kDefaultOrigin.longitude_deg) < 1e-6)
    return true;
  throw InputError(
      name, "the origin (OriginGeopoint) lies outside the tileset, which spans " + tiles::describe_extent(*tree_));
}

std::vector<std::string> WorkingSet::attribution() const {
  const std::lock_guard lock(loading_mutex_);
  std::vector<std::string> all = attribution_;
  if (source_) base::add_distinct(source_->attribution(), all);
  return all;
}

/// Whether it fits into memory.
bool WorkingSet::load_whole_region(const Progress& progress) {
  Lock lock(loading_mutex_);
  Attempt attempt({}, scenes_.detail(), scenes_.detail());
  // An estimate is wrong by much less than this, so a place that fits is not refused.
  const tiles::TileCut cut = tiles::select_cut(*tree_, refinement_criterion({}, attempt.detail));
  if (cut.contents.size() > kSampledContents && estimate_bytes(cut, progress) > 3 * scene_limit_bytes()) return false;
  if (make(attempt, lock, progress) != Outcome::kMade) return false;
  enter(std::move(attempt).prepared());
  return true;
}

SensorCriterion WorkingSet::sensor_criterion(const DetailLimit& detail) const {
  SensorCriterion wanted{placement_.T_local_tileset, detail, options_.load.error_m, options_.max_distance_m, {}};
  if (placement_.local_frame && tiles::is_georeferenced(*tree_)) wanted.horizon.emplace(*placement_.local_frame);
  return wanted;
}

tiles::RefinementCriterion WorkingSet::refinement_criterion(const SensorCells& cells, const DetailLimit& detail) const {
  const geometry::SE3 T_local_tileset = placement_.T_local_tileset;
  tiles::RefinementCriterion all =
      follows_sensors_ ? sensor_criterion(detail).for_cells(cells)
                       : tiles::region_criterion(placement_.region, T_local_tileset, options_.load.error_m);
  for (const PinnedRegion& pinned : pinned_)
    all =
        tiles::union_criterion(std::move(all), tiles::region_criterion(pinned.region, T_local_tileset, pinned.error_m));
  return all;
}

/// The largest error of the cut's tiles that could have been refined, pixels. Tiles without content, whose children are
/// shown whatever their error, do not count.
double WorkingSet::largest_error_px(const tiles::TileCut& cut, const SensorCells& cells) const {
  double worst_px = 0.0;
  const DetailLimit any{std::numeric_limits<double>::infinity()};
  const tiles::RefinementCriterion criterion = sensor_criterion(any).for_cells(cells, &worst_px);
  for (const tiles::CutContent& content : cut.contents) {
    if (tree_->children(content.node).empty()) continue;
    criterion.is_fine_enough(tree_->volume(content.node), content.geometric_error_m);
  }
  return worst_px;
}

std::shared_ptr<const ResidentScene> WorkingSet::load_for(std::span<const SensorViewpoint> viewpoints) {
  if (!follows_sensors_) return current();
  const SensorCells cells = cells_around(viewpoints);
  std::shared_ptr<const ResidentScene> scene = enter_prepared(cells);
  if (!scene) {
    const Waiting waiting(waiting_);
    Lock lock(loading_mutex_);
    scene = enter_prepared(cells);  // another caller may have waited for the same
    if (!scene) {
      ++waits_;
      PreparedScene next = load(cells, lock, {});
      scene = next.scene;
      enter(std::move(next));
      make_room(nullptr);
    }
  }
  if (options_.prefetch) scenes_.plan(viewpoints);
  return scene;
}

/// The scene for these cells, if it is at hand, which becomes the present one.
std::shared_ptr<const ResidentScene> WorkingSet::enter_prepared(const SensorCells& cells) {
  const std::optional<PreparedScenes::Entered> entered = scenes_.enter(cells, options_.retry_after);
  if (!entered) return nullptr;
  tell_detail(*entered);
  return entered->scene;
}

void WorkingSet::enter(PreparedScene next) { tell_detail(scenes_.enter(std::move(next))); }

/// Says the error of the scene that was entered, if the limit had to be raised for it.
void WorkingSet::tell_detail(const PreparedScenes::Entered& entered) {
  error_px_ = std::max(options_.error_px, entered.worst_px);
  const DetailLimit& now = entered.now;
  if (entered.before == now) return;
  std::string line =
      "the tiles that the sensors can see do not fit into memory: their screen-space error is raised to ";
  line += std::to_string(now.error_px) + " pixels";
  if (std::isfinite(now.full_detail_m))
    line += ", in proportion to distance beyond " + std::to_string(std::lround(now.full_detail_m)) + " m";
  log_line(line + "; the largest is " + std::to_string(error_px_.load()) + " pixels");
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
          transport::redact_source(options_.source),
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
  attempt.cut = tiles::select_cut(*tree_, refinement_criterion(attempt.cells, attempt.detail));
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
  std::vector<tiles::LoadedContent> contents =
      tiles::read_cut(*source_, *tree_, part_of(attempt.cut, batch), placement_.T_local_tileset, true, progress,
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
std::uintmax_t WorkingSet::estimate_bytes(const tiles::TileCut& cut, const Progress& progress) {
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
  const std::vector<tiles::LoadedContent> contents =
      tiles::read_cut(*source_, *tree_, part_of(cut, unknown), placement_.T_local_tileset, true, progress);
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
    const tiles::TileCut cut = tiles::select_cut(*tree_, refinement_criterion(cells, detail));
    if (cut.contents.size() <= kSampledContents || estimate_bytes(cut, progress) <= scene_limit_bytes() * 3 / 2)
      return detail;
    const std::optional<DetailLimit> coarser = detail.coarser();
    if (!coarser) return detail;
    detail = *coarser;
  }
}

/// As PreparedScenes::make_room(), beside what is being made.
bool WorkingSet::make_room(const Attempt* ahead) {
  return scenes_.make_room(ahead == nullptr ? nullptr : &ahead->cells, preparing_, options_.max_memory_bytes);
}

/// Runs in a thread of its own, with the help of no other: clock and pictures have the remaining cores.
void WorkingSet::prefetch(const std::stop_token& stop) {
  tbb::task_arena alone(1);
  while (const std::optional<std::vector<SensorCells>> ahead = scenes_.wait_for_plan(stop)) {
    for (const SensorCells& cells : *ahead) {
      while (alone.execute([&] { return prepare_ahead(cells); }) == Outcome::kInterrupted && is_ahead(cells))
        while (waiting_ > 0 && !stop.stop_requested()) std::this_thread::sleep_for(kWaitForOthers);
    }
  }
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

/// Whether making the scene of these cells ahead must end: somebody waits, or they do not lie ahead any more.
bool WorkingSet::is_interrupted(const SensorCells& cells) const { return waiting_ > 0 || !is_ahead(cells); }

bool WorkingSet::is_ahead(const SensorCells& cells) const {
  return !prefetcher_.get_stop_token().stop_requested() && scenes_.is_ahead(cells);
}

Vec3 WorkingSet::anchor() const {
  return placement_.region.size.norm() < kMaxAnchoredExtent_m ? placement_.region.center : Vec3(Vec3::Zero());
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
    throw InputError(transport::redact_source(options_.source),
                     "the region needs more memory than is left: request a smaller region or coarser tiles");
  }
  enter(std::move(attempt).prepared());
  return current()->loaded();
}

geometry::TriangleMesh WorkingSet::triangles_in(const Box3& box_local, double error_m) const {
  if (!tree_) return scene::merge_meshes(current()->scene().meshes());
  transport::require_permitted(source_->terms(), transport::Use::kExtract, options_.load.source.terms_accepted,
                               transport::redact_source(options_.source));
  return read_triangles(box_local, error_m, Broken::kRefused);
}

geometry::TriangleMesh WorkingSet::read_triangles(const Box3& box_local, double error_m, Broken broken) const {
  const std::string name = transport::redact_source(options_.source);
  const Waiting waiting(waiting_);
  const std::lock_guard lock(loading_mutex_);
  const tiles::Region region{box_local.center(), box_local.sizes(), {}};
  const tiles::TileCut cut =
      tiles::select_cut(*tree_, tiles::region_criterion(region, placement_.T_local_tileset, error_m));
  if (!cut.failures.empty() && broken == Broken::kRefused) throw InputError(name, cut.failures.front());
  std::vector<tiles::LoadedContent> contents =
      tiles::read_cut(*source_, *tree_, cut, placement_.T_local_tileset, false, {}, scene_limit_bytes());
  if (contents.size() < cut.contents.size()) throw InputError(name, "the region needs more memory than the limit");
  std::vector<imaging::TexturedMesh> meshes;
  for (tiles::LoadedContent& content : contents) {
    if (!content.failure.empty() && broken == Broken::kRefused) throw InputError(name, content.failure);
    std::ranges::move(content.meshes, std::back_inserter(meshes));
  }
  return scene::merge_meshes(meshes);
}

std::optional<double> WorkingSet::surface_z(double x, double y, double below_z) const {
  const double own_m = std::abs(placement_.region.center.z()) + placement_.region.size.z();
  const double reach_m = placement_.local_frame ? kMaxHeight_m : std::max(kMaxHeight_m, own_m);
  const Box3 column(Vec3(x - 0.5, y - 0.5, -reach_m), Vec3(x + 0.5, y + 0.5, reach_m));
  imaging::TexturedMesh mesh;
  mesh.mesh = tree_ ? read_triangles(column, 0.0, Broken::kLeftOut) : triangles_in(column, 0.0);
  if (mesh.mesh.triangles.empty()) return std::nullopt;
  const double top = std::min(below_z, reach_m);
  const scene::Scene scene({mesh}, Vec3(x, y, 0.0));
  const auto hit = scene.intersect({{x, y, top}, -Vec3::UnitZ()}, 2.0 * reach_m);
  if (!hit) return std::nullopt;
  return scene.position(*hit).z();
}

}  // namespace tileflight::simulator
