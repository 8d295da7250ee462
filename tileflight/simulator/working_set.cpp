#include "tileflight/simulator/working_set.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "tileflight/base/input_error.h"
#include "tileflight/base/string_lists.h"
#include "tileflight/simulator/camera_settings.h"
#include "tileflight/tiles/cut_reader.h"
#include "tileflight/transport/open_source.h"
#include "tileflight/transport/terms.h"

namespace tileflight::simulator {
namespace {

using geometry::Box3;
using geometry::Vec3;

/// Half the diagonal of a cell: the maximum distance of a sensor from its centre.
const double kCellRadius_m = 0.5 * std::sqrt(3.0) * WorkingSet::kCellSize_m;
constexpr double kErrorGrowth = 1.5;     ///< factor by which the allowed error is raised if memory is short
constexpr double kCoarsest_px = 4096.0;  ///< upper limit of the allowed error
constexpr std::size_t kMaxPinned = 32;
constexpr double kMaxOriginDistance_m = 20e3;
constexpr double kMaxAnchoredExtent_m = 1e5;  ///< above it, sensors may be far from the centre of the place
constexpr std::chrono::seconds kRetryAfter{10};
constexpr double kMaxHeight_m = 2e4;  ///< vertical search range for surfaces

Box3 bounding_box(const std::vector<imaging::TexturedMesh>& meshes) {
  Box3 box;
  for (const imaging::TexturedMesh& mesh : meshes) {
    for (const Vec3& vertex : mesh.mesh.vertices) box.extend(vertex);
  }
  if (box.isEmpty()) box.extend(Vec3(Vec3::Zero()));
  return box;
}

}  // namespace

WorkingSet::WorkingSet(const SimulatorOptions& options, SimulatorLog log, const Progress& progress)
    : options_(options), log_(std::move(log)), error_px_(options.error_px) {
  if (!(options.error_px > 0.0)) throw InputError("error in pixels", "must be above 0");
  open(progress);
  choose_residency(progress);
}

WorkingSet::WorkingSet(const SimulatorOptions& options, std::vector<imaging::TexturedMesh> meshes, SimulatorLog log)
    : options_(options), log_(std::move(log)), error_px_(options.error_px) {
  const Box3 box = bounding_box(meshes);
  placement_.region = {box.center(), box.sizes()};
  if (options.load.origin) placement_.local_frame.emplace(*options.load.origin);
  LoadedRegion loaded;
  loaded.complete = true;
  loaded.tiles_wanted = loaded.tiles_loaded = 1;
  loaded.bytes = resident_bytes(meshes);
  std::vector<ResidentTile> tiles;
  tiles.push_back({"", 0.0, std::move(meshes)});
  set_current(std::make_shared<const ResidentScene>(std::move(tiles), box.center(), loaded));
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
  if (follows_sensors_) return;
  const std::lock_guard lock(loading_mutex_);
  if (auto place = try_load({}, progress)) return set_current(*place);
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

std::shared_ptr<const ResidentScene> WorkingSet::current() const {
  const std::lock_guard lock(current_mutex_);
  return current_;
}

void WorkingSet::set_current(std::shared_ptr<const ResidentScene> place) {
  const std::lock_guard lock(current_mutex_);
  current_ = std::move(place);
}

std::vector<WorkingSet::Cell> WorkingSet::cells_around(std::span<const SensorViewpoint> viewpoints) const {
  std::vector<Cell> cells;
  for (const SensorViewpoint& viewpoint : viewpoints) {
    Cell cell{};
    for (int axis = 0; axis < 3; ++axis)
      cell[static_cast<std::size_t>(axis)] = (std::floor(viewpoint.position[axis] / kCellSize_m) + 0.5) * kCellSize_m;
    cell[3] = viewpoint.pixels_per_rad;
    cells.push_back(cell);
  }
  std::ranges::sort(cells);
  // The highest resolution of a cell's viewpoints counts.
  std::vector<Cell> distinct;
  for (const Cell& cell : cells) {
    if (!distinct.empty() && std::equal(cell.begin(), cell.begin() + 3, distinct.back().begin())) distinct.pop_back();
    distinct.push_back(cell);
  }
  return distinct;
}

tiles::RefinementCriterion WorkingSet::refinement_criterion(const std::vector<Cell>& cells) const {
  const geometry::SE3 T_local_tileset = placement_.T_local_tileset;
  tiles::RefinementCriterion all;
  if (follows_sensors_) {
    const auto fine_enough = [cells, T_local_tileset, error_px = error_px_.load(), error_m = options_.load.error_m](
                                 const tiles::BoundingVolume& volume, double geometric_error_m) {
      if (geometric_error_m <= error_m) return true;
      return std::ranges::all_of(cells, [&](const Cell& cell) {
        const double away_m = tiles::distance_m(volume, T_local_tileset, {cell[0], cell[1], cell[2]}) - kCellRadius_m;
        return geometric_error_m * cell[3] <= error_px * std::max(0.0, away_m);
      });
    };
    all = {.intersects = [](const tiles::BoundingVolume&) { return true; }, .is_fine_enough = fine_enough};
  } else {
    all = tiles::region_criterion(placement_.region, T_local_tileset, options_.load.error_m);
  }
  for (const PinnedRegion& pinned : pinned_)
    all =
        tiles::union_criterion(std::move(all), tiles::region_criterion(pinned.region, T_local_tileset, pinned.error_m));
  return all;
}

std::shared_ptr<const ResidentScene> WorkingSet::load_for(std::span<const SensorViewpoint> viewpoints) {
  if (!follows_sensors_) return current();
  const std::lock_guard lock(loading_mutex_);
  const std::vector<Cell> cells = cells_around(viewpoints);
  if (const auto place = current(); place && cells == cells_ && !(place->loaded().tiles_failed > 0 && may_retry()))
    return place;
  return load(cells, {});
}

/// Loads the scene for these cells; requires loading_mutex_.
std::shared_ptr<const ResidentScene> WorkingSet::load(const std::vector<Cell>& cells, const Progress& progress) {
  while (true) {
    if (auto place = try_load(cells, progress)) {
      set_current(*place);
      cells_ = cells;
      return *place;
    }
    if (!pinned_.empty()) {
      log_line(
          "the tiles that the sensors can see do not fit into memory: the oldest region of tfLoadRegion is unloaded");
      pinned_.erase(pinned_.begin());
      continue;
    }
    if (!follows_sensors_ || error_px_ * kErrorGrowth > kCoarsest_px)
      throw InputError(transport::redact_source(options_.source), "does not fit into the memory limit (--memory)");
    error_px_ = error_px_ * kErrorGrowth;
    log_line("the tiles that the sensors can see do not fit into memory: their screen-space error is raised to " +
             std::to_string(error_px_.load()) + " pixels");
  }
}

/// nullopt if it exceeds the memory limit.
std::optional<std::shared_ptr<const ResidentScene>> WorkingSet::try_load(const std::vector<Cell>& cells,
                                                                         const Progress& progress) {
  const tiles::TileCut cut = tiles::select_cut(*tree_, refinement_criterion(cells));
  const std::shared_ptr<const ResidentScene> before = current();
  if (before && cut.hash == cut_hash_ && before->loaded().tiles_failed == 0) return before;
  std::vector<ResidentTile> tiles(cut.contents.size());
  std::vector<std::size_t> missing;
  for (std::size_t i = 0; i < tiles.size(); ++i) {
    tiles[i].identity = cut.contents[i].identity;
    tiles[i].geometric_error_m = cut.contents[i].geometric_error_m;
    const ResidentTile* known = before ? before->find(tiles[i].identity) : nullptr;
    if (known != nullptr) {
      tiles[i].meshes = before->copy_meshes(*known);
    } else {
      missing.push_back(i);
    }
  }
  LoadedRegion loaded;
  loaded.tiles_wanted = static_cast<int>(cut.contents.size() + cut.failures.size());
  loaded.geometric_error_max = static_cast<float>(cut.geometric_error_max_m);
  loaded.failures = cut.failures;
  if (!read_missing(cut, missing, tiles, loaded, progress)) return std::nullopt;
  for (const ResidentTile& tile : tiles) loaded.bytes += resident_bytes(tile.meshes);
  if (loaded.bytes > scene_limit_bytes()) return std::nullopt;
  loaded.tiles_failed = static_cast<int>(loaded.failures.size());
  loaded.tiles_loaded = loaded.tiles_wanted - loaded.tiles_failed;
  loaded.complete = loaded.tiles_failed == 0;
  if (!loaded.complete) last_failure_ = std::chrono::steady_clock::now();
  for (const std::string& failure : loaded.failures) log_line(failure);
  cut_hash_ = cut.hash;
  ++scenes_built_;
  return std::make_shared<const ResidentScene>(std::move(tiles), anchor(), std::move(loaded), before.get());
}

Vec3 WorkingSet::anchor() const {
  return placement_.region.size.norm() < kMaxAnchoredExtent_m ? placement_.region.center : Vec3(Vec3::Zero());
}

/// Whether to retry tiles that could not be read.
bool WorkingSet::may_retry() {
  const auto now = std::chrono::steady_clock::now();
  if (now - last_failure_ < kRetryAfter) return false;
  last_failure_ = now;
  return true;
}

/// Returns false if the missing tiles exceed the memory limit. Tiles that cannot be read lose their identity, so that
/// the next scene does not treat them as loaded.
bool WorkingSet::read_missing(const tiles::TileCut& cut, const std::vector<std::size_t>& missing,
                              std::vector<ResidentTile>& tiles, LoadedRegion& loaded, const Progress& progress) {
  tiles::TileCut part;
  for (const std::size_t i : missing) part.contents.push_back(cut.contents[i]);
  std::vector<tiles::LoadedContent> contents =
      tiles::read_cut(*source_, *tree_, part, placement_.T_local_tileset, true, progress, scene_limit_bytes());
  if (contents.size() < missing.size()) return false;
  for (std::size_t k = 0; k < missing.size(); ++k) {
    ResidentTile& tile = tiles[missing[k]];
    if (!contents[k].failure.empty()) {
      loaded.failures.push_back(contents[k].failure);
      tile.identity.clear();
      continue;
    }
    ++tiles_read_;
    tile.meshes = std::move(contents[k].meshes);
    base::add_distinct(contents[k].copyrights, attribution_);
  }
  return true;
}

LoadedRegion WorkingSet::add_region(const Box3& box_local, double error_m,
                                    std::span<const SensorViewpoint> viewpoints) {
  if (!tree_) return current()->loaded();
  const std::lock_guard lock(loading_mutex_);
  const std::vector<PinnedRegion> before = pinned_;
  if (pinned_.size() >= kMaxPinned) pinned_.erase(pinned_.begin());
  pinned_.push_back({{box_local.center(), box_local.sizes(), {}}, error_m});
  const std::vector<Cell> cells = cells_around(viewpoints);
  const auto place = try_load(cells, {});
  if (!place) {
    pinned_ = before;
    throw InputError(transport::redact_source(options_.source),
                     "the region needs more memory than is left: request a smaller region or coarser tiles");
  }
  set_current(*place);
  cells_ = cells;
  return (*place)->loaded();
}

geometry::TriangleMesh WorkingSet::triangles_in(const Box3& box_local, double error_m) const {
  if (!tree_) return scene::merge_meshes(current()->scene().meshes());
  transport::require_permitted(source_->terms(), transport::Use::kExtract, options_.load.source.terms_accepted,
                               transport::redact_source(options_.source));
  return read_triangles(box_local, error_m, Broken::kRefused);
}

geometry::TriangleMesh WorkingSet::read_triangles(const Box3& box_local, double error_m, Broken broken) const {
  const std::string name = transport::redact_source(options_.source);
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
