#include "tileflight/capture/preview/coverage.h"

#include <algorithm>
#include <nlohmann/json.hpp>
#include <set>
#include <sstream>

#include "tileflight/capture/preview/strategy_result.h"
#include "tileflight/capture/vehicle/flight_plan.h"
#include "tileflight/core/base/files.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/memory_budget.h"
#include "tileflight/core/base/output_folder.h"
#include "tileflight/core/base/program.h"
#include "tileflight/tiles/fetch/open_source.h"
#include "tileflight/world/ground_truth/cell_sets.h"
#include "tileflight/world/ground_truth/voxelize.h"
#include "tileflight/world/place/place_reader.h"
#include "tileflight/world/scene/scene.h"

namespace tileflight::preview {

namespace fs = std::filesystem;
namespace {

using nlohmann::json;

/// The region's cells that each content touches.
class CellCoverage {
 public:
  CellCoverage(const tileset::Region& region, double edge_m, std::size_t contents)
      : region_(region), edge_m_(edge_m), cells_(contents) {}

  void add(std::uint32_t id, const tileset::LoadedContent& content) {
    const geometry::TriangleMesh mesh = scene::merge_meshes(content.meshes);
    if (mesh.triangles.empty()) return;
    geometry::VoxelGrid grid = ground_truth::voxelize(mesh, region_.box(), edge_m_);
    std::erase_if(grid.occupied, [&](const geometry::Cell& cell) { return is_outside(grid.center(cell)); });
    cells_.set(id, grid);
  }
  std::uintmax_t bytes() const { return cells_.bytes(); }

  /// Sets the occupied cells to those of the region's cut, once all contents are added.
  void finish(const ContentIds& region_cut) {
    region_cut_ = region_cut;
    occupied_ = cells_.count_covered(region_cut, std::vector<ContentIds>{region_cut}).front();
  }
  std::int64_t occupied() const { return occupied_; }
  /// The largest share of the occupied cells that one of these sets of tiles has.
  double largest_share(const std::vector<ContentIds>& tiles) const {
    const std::vector<std::int64_t> counts = cells_.count_covered(region_cut_, tiles);
    return occupied_ == 0 ? 0.0
                          : static_cast<double>(*std::ranges::max_element(counts)) / static_cast<double>(occupied_);
  }

 private:
  bool is_outside(const geometry::Vec3& center) const {
    return !region_.parts.empty() &&
           std::ranges::none_of(region_.parts, [&](const auto& part) { return contains(part, center); });
  }

  tileset::Region region_;
  double edge_m_;
  ground_truth::CellSets cells_;
  ContentIds region_cut_;
  std::int64_t occupied_ = 0;
};

double mean_share(const StrategyResult& strategy_result, std::int64_t PixelCounts::*which) {
  double sum = 0.0;
  for (const PixelCounts& shares : strategy_result.shares) sum += shares.share(shares.*which);
  return sum / static_cast<double>(strategy_result.shares.size());
}

json describe(const StrategyResult& strategy_result, const FrameSampling& watch, const CoverageContents& contents) {
  std::set<std::uint32_t> distinct;
  std::size_t most = 0;
  std::int64_t memory = 0, bytes = 0;
  for (const ContentIds& ids : strategy_result.tiles) {
    std::int64_t at_once = 0;
    for (const std::uint32_t id : ids) at_once += contents.facts(id).decoded_bytes;
    memory = std::max(memory, at_once);
    most = std::max(most, ids.size());
    distinct.insert(ids.begin(), ids.end());
  }
  for (const std::uint32_t id : distinct) bytes += contents.facts(id).bytes;
  const std::size_t worst = worst_frame(strategy_result);
  const PixelCounts& at_worst = strategy_result.shares[worst];
  return {{"about", strategy_result.strategy.description},
          {"tiles", distinct.size()},
          {"tiles_at_once", most},
          {"bytes", bytes},
          {"memory_bytes", memory},
          {"right", mean_share(strategy_result, &PixelCounts::right)},
          {"coarser", mean_share(strategy_result, &PixelCounts::coarser)},
          {"missing", mean_share(strategy_result, &PixelCounts::missing)},
          {"missing_worst", at_worst.share(at_worst.missing)},
          {"missing_worst_frame", watch.frames[worst]},
          {"cells_share", strategy_result.cells_share}};
}

/// The content of coverage.json, for all strategies.
json result_json(const CoverageSettings& settings, const FrameSampling& watch, const std::vector<StrategyResult>& all,
                 const CoverageContents& contents, const ContentIds& truth, const CellCoverage& cells) {
  json result{{"source", fetch::redact_source(settings.source)},
              {"flight", settings.flight.string()},
              {"frames", watch.trajectory.size()},
              {"frames_looked_at", watch.frames.size()},
              {"error_px", settings.error_px},
              {"geometric_error_wanted", settings.load.error_m},
              {"tiles_seen", truth.size()},
              {"voxel_size", settings.voxel_m},
              {"voxels_occupied", cells.occupied()},
              {"warnings", watch.notes},
              {"version", base::version()}};
  for (const StrategyResult& strategy_result : all)
    result["strategies"][strategy_result.strategy.name] = describe(strategy_result, watch, contents);
  return result;
}

/// The content of frames.csv: the shares of each frame by each strategy.
std::string frames_csv(const std::vector<StrategyResult>& all, const FrameSampling& watch) {
  std::ostringstream csv;
  csv << "frame,time_s,strategy,pixels,right,coarser,missing\n";
  for (std::size_t i = 0; i < watch.frames.size(); ++i) {
    for (const StrategyResult& strategy_result : all) {
      const PixelCounts& s = strategy_result.shares[i];
      csv << watch.frames[i] << ',' << watch.trajectory.poses[watch.frames[i]].time_s << ','
          << strategy_result.strategy.name << ',' << s.pixels << ',' << s.right << ',' << s.coarser << ',' << s.missing
          << '\n';
    }
  }
  return csv.str();
}

using nlohmann::json;

/// Share of the memory limit for the textures of a picture's scene, as they are rendered.
constexpr std::uintmax_t kPictureDivisor = 4;

std::vector<StrategyResult> select_tiles(const std::vector<TileStrategy>& strategies, const FrameSampling& watch,
                                         tileset::TilesetTree& tree, CoverageContents& contents) {
  std::vector<StrategyResult> all;
  for (const TileStrategy& strategy : strategies) {
    StrategyResult result{.strategy = strategy};
    const std::size_t times = strategy.is_fixed ? 1 : watch.frames.size();
    for (std::size_t i = 0; i < times; ++i)
      result.tiles.push_back(contents.add(tileset::select_cut(tree, strategy.criterion(watch.pose(i)))));
    all.push_back(std::move(result));
  }
  return all;
}

/// Size of the contents above a cut that a client would also have read while descending from the root.
std::int64_t ancestor_bytes(const ContentIds& cut, const CoverageContents& contents, fetch::TileSource& source,
                            tileset::TilesetTree& tree) {
  std::set<std::string> uris;
  for (const std::uint32_t id : cut) {
    for (auto above = tree.node(contents[id].node).parent; above; above = tree.node(*above).parent) {
      const std::size_t above_contents = tree.tile(*above)->contents.size();
      for (std::size_t c = 0; c < above_contents; ++c) {
        if (!tree.is_external_tileset(*above, c)) uris.insert(tree.content_uri(*above, c));
      }
    }
  }
  for (const std::uint32_t id : cut) uris.erase(contents[id].uri);
  std::int64_t bytes = 0;
  for (const std::string& uri : uris) bytes += static_cast<std::int64_t>(source.size(uri).value_or(0));
  return bytes;
}

StrategySettings strategy_settings(const CoverageSettings& settings, const FrameSampling& watch,
                                   const tileset::Placement& placement) {
  StrategySettings s{.camera = watch.camera,
                     .region = placement.region,
                     .T_local_tileset = placement.T_local_tileset,
                     .error_m = settings.load.error_m,
                     .error_px = settings.error_px,
                     .follow_height_m = settings.follow_height_m,
                     .viewer = {.width = settings.viewer_width,
                                .height = settings.viewer_height,
                                .horizontal_fov_deg = settings.viewer_fov_deg,
                                .max_error_px = settings.viewer_max_error_px}};
  for (const geometry::StampedPose& pose : watch.trajectory.poses) s.T_local_camera.push_back(pose.T_local_camera);
  return s;
}

void require_surface(const CoverageContents& contents, const ContentIds& truth, const std::string& name) {
  const bool has_surface = !contents.bounds(truth).isEmpty();
  const bool has_points = std::ranges::any_of(truth, [&](std::uint32_t id) { return contents.facts(id).has_points; });
  if (!has_surface) place::require_surface({}, has_points, name);
}

void check(const CoverageSettings& settings) {
  const auto positive = [](double value, const char* name) {
    if (!(value > 0.0)) throw InputError(name, "must be positive");
  };
  positive(settings.error_px, "--pixel-error");
  positive(settings.frames, "--frames");
  positive(settings.width, "--width");
  positive(settings.voxel_m, "--voxel");
  positive(settings.viewer_max_error_px, "--viewer-error");
  if (!(settings.viewer_fov_deg > 0.0 && settings.viewer_fov_deg < 180.0))
    throw InputError("--viewer-fov", "must be above 0 and below 180 degrees");
}

}  // namespace

nlohmann::json measure_coverage(const CoverageSettings& settings, const fs::path& out, bool replace,
                                const Progress& progress) {
  check(settings);
  base::OutputFolder output{
      .folder = out, .command = "coverage", .replace = replace, .inputs = vehicle::referenced_files(settings.flight)};
  output.inputs.push_back(fetch::local_path_of_source(settings.source));
  base::require_writable(output);
  const FrameSampling watch = sample_frames(settings);
  const std::unique_ptr<fetch::TileSource> source = fetch::open_source(settings.source, settings.load.source);
  const std::string name = fetch::redact_source(settings.source);
  fetch::require_permitted(source->terms(), fetch::Use::kAnalyse, settings.load.source.terms_accepted, name);
  tileset::TilesetTree tree(*source);
  tileset::require_supported_extensions(tree.tileset(tree.root()), name);
  const tileset::Placement placement = tileset::resolve_placement(tree, settings.load, name);
  const StrategySettings strategy = strategy_settings(settings, watch, placement);

  CoverageContents contents(*source, tree, placement.T_local_tileset,
                            settings.max_memory_bytes.value_or(base::default_memory_bytes()));
  std::vector<StrategyResult> all = select_tiles(make_tile_strategies(strategy), watch, tree, contents);
  const ContentIds truth = contents.add(tileset::select_cut(tree, full_detail_criterion(strategy)));
  if (truth.empty()) throw InputError(settings.flight.string(), "sees no tile of " + name);
  CellCoverage cells(placement.region, settings.voxel_m, contents.size());
  contents.read_all(
      settings.load.allow_incomplete,
      [&](std::uint32_t id, const tileset::LoadedContent& content) {
        cells.add(id, content);
        contents.reserve(cells.bytes());
      },
      progress);
  require_surface(contents, truth, name);
  count_pixels_of_frames(watch, contents, truth, tree, settings, progress, all);
  cells.finish(all.back().tiles.front());
  for (StrategyResult& strategy_result : all) strategy_result.cells_share = cells.largest_share(strategy_result.tiles);
  json result = result_json(settings, watch, all, contents, truth, cells);
  for (const StrategyResult& strategy_result : all) {
    if (strategy_result.strategy.is_fixed)
      result["strategies"][strategy_result.strategy.name]["bytes_above"] =
          ancestor_bytes(strategy_result.tiles.front(), contents, *source, tree);
  }
  const std::size_t worst = worst_frame(all.front());
  contents.reserve(cells.bytes() + contents.max_memory_bytes() / kPictureDivisor);
  result["picture_frame"] = watch.frames[worst];
  base::write_folder(output, [&](const fs::path& temporary) {
    write_pictures(temporary, all, worst, watch, contents, truth, settings);
    base::write_file(temporary / "frames.csv", frames_csv(all, watch));
    base::write_file(temporary / "coverage.json", result.dump(2) + "\n");
  });
  return result;
}

}  // namespace tileflight::preview
