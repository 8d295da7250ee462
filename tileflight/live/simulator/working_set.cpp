#include "tileflight/live/simulator/working_set.h"

#include <tbb/task_arena.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>

#include "tileflight/core/base/formatted_text.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/live/simulator/settings.h"
#include "tileflight/tiles/fetch/open_source.h"
#include "tileflight/tiles/fetch/terms.h"
#include "tileflight/tiles/tileset/cut_reader.h"
#include "tileflight/world/place/place_reader.h"

namespace tileflight::simulator {
namespace {

using geometry::Box3;
using geometry::Vec3;

constexpr double kMaxOriginDistance_m = 20e3;
constexpr double kMaxAnchoredExtent_m = 1e5;  ///< above it, sensors may be far from the centre of the place
constexpr double kMaxHeight_m = 2e4;          ///< vertical search range for surfaces
constexpr std::chrono::milliseconds kWaitForOthers{1};

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
  const std::string name = fetch::redact_source(options_.source);
  report_progress(progress, 0, 0, "reading the tileset");
  source_ = fetch::open_source(options_.source, options_.load.source);
  fetch::require_permitted(source_->terms(), fetch::Use::kAnalyse, options_.load.source.terms_accepted, name);
  tree_ = std::make_unique<tileset::TilesetTree>(*source_);
  tileset::require_supported_extensions(tree_->tileset(tree_->root()), name);
}

/// A region that is requested or small is loaded completely, if it fits; otherwise tiles follow the sensors.
void WorkingSet::choose_residency(const Progress& progress) {
  const std::string name = fetch::redact_source(options_.source);
  tileset::LoadOptions load = options_.load;
  const bool names_region = load.center || load.center_local || load.size || !load.areas.empty();
  follows_sensors_ = options_.residency == TileResidency::kFollow;
  if (!follows_sensors_) {
    try {
      placement_ = tileset::resolve_placement(*tree_, load, name);
    } catch (const InputError&) {
      if (names_region || options_.residency == TileResidency::kRegion) throw;
      follows_sensors_ = true;
    }
  }
  if (follows_sensors_) {
    load.flight.emplace();
    placement_ = tileset::resolve_placement(*tree_, load, name);
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
  if (!options_.load.origin || !tileset::is_georeferenced(*tree_)) return false;
  const Box3 box = tileset::local_bounding_box(tree_->volume(tree_->root()), placement_.T_local_tileset);
  if (box.exteriorDistance(Vec3(0.0, 0.0, box.center().z())) < kMaxOriginDistance_m) return false;
  const geometry::Geodetic& origin = *options_.load.origin;
  if (std::abs(origin.latitude_deg - kDefaultOrigin.latitude_deg) < 1e-6 &&
      std::abs(origin.longitude_deg - kDefaultOrigin.longitude_deg) < 1e-6)
    return true;
  throw InputError(name, "the origin (OriginGeopoint) lies outside the tileset, which spans " +
                             tileset::describe_extent(*tree_) +
                             "; remove OriginGeopoint from the settings, or give a point inside");
}

std::vector<std::string> WorkingSet::attribution() const {
  const std::lock_guard lock(loading_mutex_);
  std::vector<std::string> all = attribution_;
  if (source_) base::add_distinct(source_->attribution(), all);
  return all;
}

SensorCriterion WorkingSet::sensor_criterion(const DetailLimit& detail) const {
  SensorCriterion wanted{placement_.T_local_tileset, detail, options_.load.error_m, options_.max_distance_m, {}};
  if (placement_.local_frame && tileset::is_georeferenced(*tree_)) wanted.horizon.emplace(*placement_.local_frame);
  return wanted;
}

tileset::RefinementCriterion WorkingSet::refinement_criterion(const SensorCells& cells,
                                                              const DetailLimit& detail) const {
  const geometry::SE3 T_local_tileset = placement_.T_local_tileset;
  tileset::RefinementCriterion all =
      follows_sensors_ ? sensor_criterion(detail).for_cells(cells)
                       : tileset::region_criterion(placement_.region, T_local_tileset, options_.load.error_m);
  for (const PinnedRegion& pinned : pinned_)
    all = tileset::union_criterion(std::move(all),
                                   tileset::region_criterion(pinned.region, T_local_tileset, pinned.error_m));
  return all;
}

/// The largest error of the cut's tiles that could have been refined, pixels. Tiles without content, whose children are
/// shown whatever their error, do not count.
double WorkingSet::largest_error_px(const tileset::TileCut& cut, const SensorCells& cells) const {
  double worst_px = 0.0;
  const DetailLimit any{std::numeric_limits<double>::infinity()};
  const tileset::RefinementCriterion criterion = sensor_criterion(any).for_cells(cells, &worst_px);
  for (const tileset::CutContent& content : cut.contents) {
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

/// Returns whether making the scene of these cells ahead must end: a caller waits, or the cells no longer lie ahead.
bool WorkingSet::is_interrupted(const SensorCells& cells) const { return waiting_ > 0 || !is_ahead(cells); }

bool WorkingSet::is_ahead(const SensorCells& cells) const {
  return !prefetcher_.get_stop_token().stop_requested() && scenes_.is_ahead(cells);
}

Vec3 WorkingSet::anchor() const {
  return placement_.region.size.norm() < kMaxAnchoredExtent_m ? placement_.region.center : Vec3(Vec3::Zero());
}

geometry::TriangleMesh WorkingSet::triangles_in(const Box3& box_local, double error_m) const {
  if (!tree_) return scene::merge_meshes(current()->scene().meshes());
  fetch::require_permitted(source_->terms(), fetch::Use::kExtract, options_.load.source.terms_accepted,
                           fetch::redact_source(options_.source));
  return read_triangles(box_local, error_m, Broken::kRefused);
}

geometry::TriangleMesh WorkingSet::read_triangles(const Box3& box_local, double error_m, Broken broken) const {
  const std::string name = fetch::redact_source(options_.source);
  const Waiting waiting(waiting_);
  const std::lock_guard lock(loading_mutex_);
  const tileset::Region region{box_local.center(), box_local.sizes(), {}};
  const tileset::TileCut cut =
      tileset::select_cut(*tree_, tileset::region_criterion(region, placement_.T_local_tileset, error_m));
  if (!cut.failures.empty() && broken == Broken::kRefused) throw InputError(name, cut.failures.front());
  std::vector<tileset::LoadedContent> contents =
      tileset::read_cut(*source_, *tree_, cut, placement_.T_local_tileset, false, {}, scene_limit_bytes());
  if (contents.size() < cut.contents.size()) throw InputError(name, "the region needs more memory than the limit");
  std::vector<imaging::TexturedMesh> meshes;
  for (tileset::LoadedContent& content : contents) {
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
