#include "tileflight/simulator/working_set.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "tileflight/geometry/input_error.h"
#include "tileflight/simulator/camera_settings.h"
#include "tileflight/tiles/cut_reader.h"
#include "tileflight/tiles/open_source.h"
#include "tileflight/tiles/terms.h"

namespace tileflight::simulator {
namespace {

using geometry::Box3;
using geometry::Vec3;

/// Half the diagonal of a cell: a sensor is no farther from its middle.
const double kCellRadius_m = 0.5 * std::sqrt(3.0) * WorkingSet::kCell_m;
constexpr double kCoarser = 1.5;         ///< by which the error allowed is raised when memory is short
constexpr double kCoarsest_px = 4096.0;  ///< beyond that there is nothing to be gained
constexpr std::size_t kMostPinned = 32;
constexpr double kElsewhere_m = 20e3;
constexpr double kLargestPlace_m = 1e5;  ///< above, the middle of the place is not where sensors are
constexpr std::chrono::seconds kRetryAfter{10};
constexpr double kTallest_m = 2e4;  ///< how far up and down a surface is looked for

Box3 box_of(const std::vector<imaging::TexturedMesh>& meshes) {
  Box3 box;
  for (const imaging::TexturedMesh& mesh : meshes) {
    for (const Vec3& vertex : mesh.mesh.vertices) box.extend(vertex);
  }
  if (box.isEmpty()) box.extend(Vec3(Vec3::Zero()));
  return box;
}

void add_distinct(const std::vector<std::string>& from, std::vector<std::string>& to) {
  for (const std::string& text : from) {
    if (std::ranges::find(to, text) == to.end()) to.push_back(text);
  }
}

}  // namespace

WorkingSet::WorkingSet(const SimulatorOptions& options, SimulatorLog log, const Progress& progress)
    : options_(options), log_(std::move(log)), error_px_(options.error_px) {
  if (!(options.error_px > 0.0)) throw InputError("error in pixels", "must be above 0");
  open(progress);
  choose_mode(progress);
}

WorkingSet::WorkingSet(const SimulatorOptions& options, std::vector<imaging::TexturedMesh> meshes, SimulatorLog log)
    : options_(options), log_(std::move(log)), error_px_(options.error_px) {
  const Box3 box = box_of(meshes);
  placement_.region = {box.center(), box.sizes()};
  if (options.load.origin) placement_.local_frame.emplace(*options.load.origin);
  LoadedRegion loaded;
  loaded.complete = true;
  loaded.tiles_wanted = loaded.tiles_loaded = 1;
  loaded.bytes = place_bytes(meshes);
  std::vector<PlacedTile> tiles;
  tiles.push_back({"", 0.0, std::move(meshes)});
  keep(std::make_shared<const Place>(std::move(tiles), box.center(), loaded));
}

void WorkingSet::say(const std::string& line) const {
  if (log_) log_(line);
}

void WorkingSet::open(const Progress& progress) {
  const std::string name = tiles::shown_source(options_.source);
  report_progress(progress, 0, 0, "reading the tileset");
  source_ = tiles::open_source(options_.source, options_.load.source);
  tiles::require_permitted(source_->terms(), tiles::Use::kAnalyse, options_.load.source.terms_accepted, name);
  tree_ = std::make_unique<tiles::TilesetTree>(*source_);
  tiles::require_supported_extensions(tree_->tileset(tree_->root()), name);
}

/// A region that is asked for or is small is read whole, if it fits; else tiles follow.
void WorkingSet::choose_mode(const Progress& progress) {
  const std::string name = tiles::shown_source(options_.source);
  tiles::LoadOptions load = options_.load;
  const bool names_region = load.center || load.center_local || load.size || !load.areas.empty();
  follows_ = options_.following == Following::kFollow;
  if (!follows_) {
    try {
      placement_ = tiles::place(*tree_, load, name);
    } catch (const InputError&) {
      if (names_region || options_.following == Following::kRegion) throw;
      follows_ = true;
    }
  }
  if (follows_) {
    load.flight.emplace();
    placement_ = tiles::place(*tree_, load, name);
  }
  if (origin_is_elsewhere(name)) {
    warnings_.push_back("OriginGeopoint is AirSim's default, which is not in this place: the place's own is taken");
    options_.load.origin.reset();
    return choose_mode(progress);
  }
  add_distinct(placement_.warnings, warnings_);
  if (follows_) return;
  const std::lock_guard lock(loading_);
  if (auto place = try_load({}, progress)) return keep(*place);
  if (options_.following == Following::kRegion) {
    throw InputError(name,
                     "the region needs more memory than is allowed: ask for less (--size), for coarser tiles "
                     "(--error), allow more (--memory), or let tiles follow (--follow sensors)");
  }
  say("the region does not fit into memory: tiles follow what the sensors can see");
  follows_ = true;
}

/// Whether the origin is AirSim's default and far from a place that has a position of its own. Throws InputError where
/// it is another one.
bool WorkingSet::origin_is_elsewhere(const std::string& name) const {
  if (!options_.load.origin || !tiles::is_georeferenced(*tree_)) return false;
  const Box3 box = tiles::bounds_local(tree_->volume(tree_->root()), placement_.T_local_tileset);
  if (box.exteriorDistance(Vec3(0.0, 0.0, box.center().z())) < kElsewhere_m) return false;
  const geometry::Geodetic& origin = *options_.load.origin;
  if (std::abs(origin.latitude_deg - kDefaultOrigin.latitude_deg) < 1e-6 &&
      std::abs(origin.longitude_deg - kDefaultOrigin.longitude_deg) < 1e-6)
    return true;
  throw InputError(name, "the origin (OriginGeopoint) lies elsewhere: the tileset spans " + tiles::extent_text(*tree_));
}

std::vector<std::string> WorkingSet::attribution() const {
  const std::lock_guard lock(loading_);
  std::vector<std::string> all = attribution_;
  if (source_) add_distinct(source_->attribution(), all);
  return all;
}

std::shared_ptr<const Place> WorkingSet::current() const {
  const std::lock_guard lock(current_mutex_);
  return current_;
}

void WorkingSet::keep(std::shared_ptr<const Place> place) {
  const std::lock_guard lock(current_mutex_);
  current_ = std::move(place);
}

std::vector<WorkingSet::Cell> WorkingSet::cells_of(std::span<const Look> looks) const {
  std::vector<Cell> cells;
  for (const Look& look : looks) {
    Cell cell{};
    for (int axis = 0; axis < 3; ++axis)
      cell[static_cast<std::size_t>(axis)] = (std::floor(look.position[axis] / kCell_m) + 0.5) * kCell_m;
    cell[3] = look.pixels_per_rad;
    cells.push_back(cell);
  }
  std::ranges::sort(cells);
  // Of a cell's looks the sharpest counts.
  std::vector<Cell> distinct;
  for (const Cell& cell : cells) {
    if (!distinct.empty() && std::equal(cell.begin(), cell.begin() + 3, distinct.back().begin())) distinct.pop_back();
    distinct.push_back(cell);
  }
  return distinct;
}

tiles::Wanted WorkingSet::wanted(const std::vector<Cell>& cells) const {
  const geometry::SE3 T_local_tileset = placement_.T_local_tileset;
  tiles::Wanted all;
  if (follows_) {
    const auto fine_enough = [cells, T_local_tileset, error_px = error_px_.load(), error_m = options_.load.error_m](
                                 const tiles::BoundingVolume& volume, double geometric_error_m) {
      if (geometric_error_m <= error_m) return true;
      return std::ranges::all_of(cells, [&](const Cell& cell) {
        const double away_m = tiles::distance_m(volume, T_local_tileset, {cell[0], cell[1], cell[2]}) - kCellRadius_m;
        return geometric_error_m * cell[3] <= error_px * std::max(0.0, away_m);
      });
    };
    all = {.meets = [](const tiles::BoundingVolume&) { return true; }, .fine_enough = fine_enough};
  } else {
    all = tiles::wanted_region(placement_.region, T_local_tileset, options_.load.error_m);
  }
  for (const Pinned& pinned : pinned_)
    all = tiles::wanted_union(std::move(all), tiles::wanted_region(pinned.region, T_local_tileset, pinned.error_m));
  return all;
}

std::shared_ptr<const Place> WorkingSet::for_looks(std::span<const Look> looks) {
  if (!follows_) return current();
  const std::lock_guard lock(loading_);
  const std::vector<Cell> cells = cells_of(looks);
  if (const auto place = current(); place && cells == cells_ && !(place->loaded().tiles_failed > 0 && may_retry()))
    return place;
  return load(cells, {});
}

/// The place for these cells; with loading_ held.
std::shared_ptr<const Place> WorkingSet::load(const std::vector<Cell>& cells, const Progress& progress) {
  while (true) {
    if (auto place = try_load(cells, progress)) {
      keep(*place);
      cells_ = cells;
      return *place;
    }
    if (!pinned_.empty()) {
      say("what the sensors can see does not fit into memory: the oldest region of tfLoadRegion is let go");
      pinned_.erase(pinned_.begin());
      continue;
    }
    if (!follows_ || error_px_ * kCoarser > kCoarsest_px)
      throw InputError(tiles::shown_source(options_.source), "does not fit into the memory allowed (--memory)");
    error_px_ = error_px_ * kCoarser;
    say("what the sensors can see does not fit into memory: tiles may err by " + std::to_string(error_px_.load()) +
        " pixels from now on");
  }
}

/// nullopt where it needs more memory than is allowed.
std::optional<std::shared_ptr<const Place>> WorkingSet::try_load(const std::vector<Cell>& cells,
                                                                 const Progress& progress) {
  const tiles::TileCut cut = tiles::select_cut(*tree_, wanted(cells));
  const std::shared_ptr<const Place> before = current();
  if (before && cut.hash == cut_hash_ && before->loaded().tiles_failed == 0) return before;
  std::vector<PlacedTile> tiles(cut.contents.size());
  std::vector<std::size_t> missing;
  for (std::size_t i = 0; i < tiles.size(); ++i) {
    tiles[i].identity = cut.contents[i].identity;
    tiles[i].geometric_error_m = cut.contents[i].geometric_error_m;
    const PlacedTile* known = before ? before->find(tiles[i].identity) : nullptr;
    if (known != nullptr) {
      tiles[i].meshes = before->meshes_of(*known);
    } else {
      missing.push_back(i);
    }
  }
  LoadedRegion loaded;
  loaded.tiles_wanted = static_cast<int>(cut.contents.size() + cut.failures.size());
  loaded.geometric_error_max = static_cast<float>(cut.geometric_error_max_m);
  loaded.failures = cut.failures;
  if (!read_missing(cut, missing, tiles, loaded, progress)) return std::nullopt;
  for (const PlacedTile& tile : tiles) loaded.bytes += place_bytes(tile.meshes);
  if (loaded.bytes > place_limit_bytes()) return std::nullopt;
  loaded.tiles_failed = static_cast<int>(loaded.failures.size());
  loaded.tiles_loaded = loaded.tiles_wanted - loaded.tiles_failed;
  loaded.complete = loaded.tiles_failed == 0;
  if (!loaded.complete) last_failure_ = std::chrono::steady_clock::now();
  for (const std::string& failure : loaded.failures) say(failure);
  cut_hash_ = cut.hash;
  ++places_built_;
  return std::make_shared<const Place>(std::move(tiles), anchor(), std::move(loaded), before.get());
}

Vec3 WorkingSet::anchor() const {
  return placement_.region.size.norm() < kLargestPlace_m ? placement_.region.center : Vec3(Vec3::Zero());
}

/// Whether it is time to ask again for tiles that could not be read.
bool WorkingSet::may_retry() {
  const auto now = std::chrono::steady_clock::now();
  if (now - last_failure_ < kRetryAfter) return false;
  last_failure_ = now;
  return true;
}

/// False where what is missing needs more memory than is allowed. Tiles that cannot be read lose their identity, so
/// that the next place does not take them for read.
bool WorkingSet::read_missing(const tiles::TileCut& cut, const std::vector<std::size_t>& missing,
                              std::vector<PlacedTile>& tiles, LoadedRegion& loaded, const Progress& progress) {
  tiles::TileCut part;
  for (const std::size_t i : missing) part.contents.push_back(cut.contents[i]);
  std::vector<tiles::ReadContent> contents =
      tiles::read_cut(*source_, *tree_, part, placement_.T_local_tileset, true, progress, place_limit_bytes());
  if (contents.size() < missing.size()) return false;
  for (std::size_t k = 0; k < missing.size(); ++k) {
    PlacedTile& tile = tiles[missing[k]];
    if (!contents[k].failure.empty()) {
      loaded.failures.push_back(contents[k].failure);
      tile.identity.clear();
      continue;
    }
    ++tiles_read_;
    tile.meshes = std::move(contents[k].meshes);
    add_distinct(contents[k].copyrights, attribution_);
  }
  return true;
}

LoadedRegion WorkingSet::add_region(const Box3& box_local, double error_m, std::span<const Look> looks) {
  if (!tree_) return current()->loaded();
  const std::lock_guard lock(loading_);
  const std::vector<Pinned> before = pinned_;
  if (pinned_.size() >= kMostPinned) pinned_.erase(pinned_.begin());
  pinned_.push_back({{box_local.center(), box_local.sizes(), {}}, error_m});
  const std::vector<Cell> cells = cells_of(looks);
  const auto place = try_load(cells, {});
  if (!place) {
    pinned_ = before;
    throw InputError(tiles::shown_source(options_.source),
                     "the region needs more memory than is left: ask for less or for coarser tiles");
  }
  keep(*place);
  cells_ = cells;
  return (*place)->loaded();
}

geometry::TriangleMesh WorkingSet::triangles_in(const Box3& box_local, double error_m) const {
  if (!tree_) return scene::merged(current()->scene().meshes());
  tiles::require_permitted(source_->terms(), tiles::Use::kExtract, options_.load.source.terms_accepted,
                           tiles::shown_source(options_.source));
  return read_triangles(box_local, error_m, Broken::kRefused);
}

geometry::TriangleMesh WorkingSet::read_triangles(const Box3& box_local, double error_m, Broken broken) const {
  const std::string name = tiles::shown_source(options_.source);
  const std::lock_guard lock(loading_);
  const tiles::Region region{box_local.center(), box_local.sizes(), {}};
  const tiles::TileCut cut =
      tiles::select_cut(*tree_, tiles::wanted_region(region, placement_.T_local_tileset, error_m));
  if (!cut.failures.empty() && broken == Broken::kRefused) throw InputError(name, cut.failures.front());
  std::vector<tiles::ReadContent> contents =
      tiles::read_cut(*source_, *tree_, cut, placement_.T_local_tileset, false, {}, place_limit_bytes());
  if (contents.size() < cut.contents.size()) throw InputError(name, "the region needs more memory than is allowed");
  std::vector<imaging::TexturedMesh> meshes;
  for (tiles::ReadContent& content : contents) {
    if (!content.failure.empty() && broken == Broken::kRefused) throw InputError(name, content.failure);
    std::ranges::move(content.meshes, std::back_inserter(meshes));
  }
  return scene::merged(meshes);
}

std::optional<double> WorkingSet::surface_z(double x, double y, double below_z) const {
  const double own_m = std::abs(placement_.region.center.z()) + placement_.region.size.z();
  const double reach_m = placement_.local_frame ? kTallest_m : std::max(kTallest_m, own_m);
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
