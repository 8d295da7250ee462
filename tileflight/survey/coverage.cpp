#include "tileflight/survey/coverage.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <set>
#include <sstream>

#include "tileflight/base/files.h"
#include "tileflight/base/input_error.h"
#include "tileflight/base/output_folder.h"
#include "tileflight/ground_truth/cell_sets.h"
#include "tileflight/ground_truth/voxelize.h"
#include "tileflight/imaging/image_files.h"
#include "tileflight/place/memory_budget.h"
#include "tileflight/place/require_surface.h"
#include "tileflight/place/version.h"
#include "tileflight/render/camera_renderer.h"
#include "tileflight/survey/coverage_contents.h"
#include "tileflight/survey/flight_cameras.h"
#include "tileflight/survey/tile_coverage.h"
#include "tileflight/survey/tile_strategies.h"
#include "tileflight/tiles/view_cone_tree.h"
#include "tileflight/transport/open_source.h"
#include "tileflight/vehicle/flight_plan.h"

namespace tileflight::survey {
namespace fs = std::filesystem;
namespace {

using nlohmann::json;

/// Share of the memory limit for the textures of a picture's scene, as they are rendered.
constexpr std::uintmax_t kPictureDivisor = 4;

/// The flight's lens and the sampled poses.
struct FrameSampling {
  imaging::Camera camera;
  geometry::Trajectory trajectory;
  std::vector<std::size_t> frames;  ///< indices into `all`

  const geometry::SE3& pose(std::size_t i) const { return trajectory.poses[frames[i]].T_local_camera; }
};

FrameSampling sample_frames(const CoverageSettings& settings) {
  const vehicle::FlightPlan plan = vehicle::read_flight_plan(settings.flight);
  RenderedFlightConfig flight;
  flight.flight = settings.flight;
  const MountedCamera camera = read_flight_cameras(flight).front();  // of a rig, the first
  FrameSampling watch{camera.calibration.camera, vehicle::frame_poses(plan), {}};
  for (geometry::StampedPose& pose : watch.trajectory.poses)
    pose.T_local_camera = pose.T_local_camera * camera.T_body_camera;
  const std::size_t all = watch.trajectory.size();
  if (all == 0) throw InputError(settings.flight.string(), "has no frames");
  const std::size_t count = std::min<std::size_t>(all, static_cast<std::size_t>(settings.frames));
  for (std::size_t i = 0; i < count; ++i)
    watch.frames.push_back(count == 1 ? 0 : (i * (all - 1) + (count - 1) / 2) / (count - 1));
  return watch;
}

imaging::Camera scale_to_width(const imaging::Camera& camera, int width) {
  if (width >= camera.width()) return camera;
  const double scale = static_cast<double>(width) / camera.width();
  return camera.scaled_to(width, std::max(1, static_cast<int>(std::lround(scale * camera.height()))));
}

/// The tiles of a strategy and the resulting counts.
struct StrategyResult {
  TileStrategy strategy;
  std::vector<ContentIds> tiles;    ///< per frame; a single entry if the strategy is fixed
  std::vector<PixelCounts> shares;  ///< per frame
  double cells_share = 0.0;

  const ContentIds& tiles_at(std::size_t frame) const { return tiles[strategy.is_fixed ? 0 : frame]; }
};

/// The region's cells that each content touches.
class CellCoverage {
 public:
  CellCoverage(const tiles::Region& region, double edge_m, std::size_t contents)
      : region_(region), edge_m_(edge_m), cells_(contents) {}

  void add(std::uint32_t id, const tiles::LoadedContent& content) {
    const geometry::TriangleMesh mesh = scene::merge_meshes(content.meshes);
    if (mesh.triangles.empty()) return;
    geometry::VoxelGrid grid = ground_truth::voxelize(mesh, region_.box(), edge_m_);
    std::erase_if(grid.occupied, [&](const geometry::Cell& cell) { return is_outside(grid.center(cell)); });
    cells_.set(id, grid);
  }

  std::uintmax_t bytes() const { return cells_.bytes(); }

  /// Once all contents are added: the occupied cells are those of the region's cut.
  void finish(const ContentIds& region_cut) {
    region_cut_ = region_cut;
    occupied_ = cells_.count_covered(region_cut, std::vector<ContentIds>{region_cut}).front();
  }

  std::int64_t occupied() const { return occupied_; }

  /// Of the occupied cells, the share that one of these has at most.
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

  tiles::Region region_;
  double edge_m_;
  ground_truth::CellSets cells_;
  ContentIds region_cut_;
  std::int64_t occupied_ = 0;
};

std::vector<StrategyResult> select_tiles(const std::vector<TileStrategy>& strategies, const FrameSampling& watch,
                                         tiles::TilesetTree& tree, CoverageContents& contents) {
  std::vector<StrategyResult> all;
  for (const TileStrategy& strategy : strategies) {
    StrategyResult result{.strategy = strategy};
    const std::size_t times = strategy.is_fixed ? 1 : watch.frames.size();
    for (std::size_t i = 0; i < times; ++i)
      result.tiles.push_back(contents.add(tiles::select_cut(tree, strategy.criterion(watch.pose(i)))));
    all.push_back(std::move(result));
  }
  return all;
}

std::vector<bool> nodes_in_memory(const ContentIds& ids, const CoverageContents& contents, std::size_t nodes) {
  std::vector<bool> in_memory(nodes);
  for (const std::uint32_t id : ids) in_memory[contents[id].node] = true;
  return in_memory;
}

/// Counts the pixels of each frame for each strategy. The scene is traced in parts that fit into memory, for as many
/// frames at once as do.
class FramePixelCounter {
 public:
  FramePixelCounter(const FrameSampling& watch, CoverageContents& contents, const ContentIds& truth,
                    const tiles::TilesetTree& tree, const CoverageSettings& settings, const Progress& progress)
      : watch_(watch),
        contents_(contents),
        tree_(tree),
        settings_(settings),
        progress_(progress),
        rays_(pixel_rays(scale_to_width(watch.camera, settings.width))),
        parts_(contents.scene_groups(truth)),
        anchor_(contents.bounds(truth).center()),
        substitutes_(contents.size()) {
    for (const std::uint32_t id : truth) substitutes_[id] = find_substitutes(tree, contents[id]);
  }

  void count(std::vector<StrategyResult>& all) {
    constexpr std::uintmax_t kPixelsDivisor = 16;  // share of the memory limit for the frames' pixels
    const std::size_t frames = watch_.frames.size();
    const std::size_t at_once = static_cast<std::size_t>(std::clamp<std::uintmax_t>(
        contents_.max_memory_bytes() / kPixelsDivisor / (rays_.size() * sizeof(PixelHit)), 1, frames));
    for (std::size_t begin = 0; begin < frames; begin += at_once) {
      const std::size_t end = std::min(frames, begin + at_once);
      const std::vector<std::vector<PixelHit>> hits = trace(begin, end);
      for (std::size_t i = begin; i < end; ++i) count_frame(i, hits[i - begin], all);
    }
  }

 private:
  std::vector<std::vector<PixelHit>> trace(std::size_t begin, std::size_t end) {
    std::vector<std::vector<PixelHit>> hits(end - begin, std::vector<PixelHit>(rays_.size()));
    const tiles::ViewCone lens = tiles::view_cone_of(watch_.camera);
    for (std::size_t k = 0; k < parts_.size(); ++k) {
      CoverageContents::OwnedMeshes meshes = contents_.meshes(parts_[k], false);
      const scene::Scene part(std::move(meshes.meshes), anchor_);
      const geometry::Box3& bounds = part.bounds();
      for (std::size_t i = begin; i < end; ++i) {
        tiles::ViewCone view = lens;
        view.position = watch_.pose(i).translation;
        view.axis = watch_.pose(i).rotation * geometry::Vec3::UnitZ();
        if (!tiles::intersects_cone(view, {bounds.center(), bounds.sizes().norm() / 2})) continue;
        trace_pixels(part, meshes.content_of_mesh, rays_, watch_.pose(i), hits[i - begin]);
      }
      // Of all groups of frames: one more part of one group is done.
      const double done = static_cast<double>(begin) * static_cast<double>(parts_.size()) +
                          static_cast<double>((end - begin) * (k + 1));
      report_progress(progress_, std::llround(done / static_cast<double>(parts_.size())),
                      static_cast<std::int64_t>(watch_.frames.size()), "checking frames");
    }
    return hits;
  }

  void count_frame(std::size_t i, const std::vector<PixelHit>& frame, std::vector<StrategyResult>& all) const {
    const double pixels_per_rad = tiles::view_cone_of(watch_.camera).pixels_per_rad;
    for (StrategyResult& result : all) {
      const std::vector<bool> in_memory = nodes_in_memory(result.tiles_at(i), contents_, tree_.node_count());
      result.shares.push_back(count_pixels(frame, substitutes_, in_memory, pixels_per_rad, settings_.error_px));
    }
  }

  const FrameSampling& watch_;
  CoverageContents& contents_;
  const tiles::TilesetTree& tree_;
  const CoverageSettings& settings_;
  const Progress& progress_;
  std::vector<std::optional<geometry::Vec3>> rays_;
  std::vector<ContentIds> parts_;
  geometry::Vec3 anchor_;
  std::vector<std::vector<Substitute>> substitutes_;
};

std::size_t worst_frame(const StrategyResult& result) {
  const auto missing = [](const PixelCounts& s) { return s.share(s.missing); };
  return static_cast<std::size_t>(std::ranges::max_element(result.shares, {}, missing) - result.shares.begin());
}

/// Takes the pixels of `part` that are nearer than those of `whole`: along the same ray, with the smaller depth.
void merge_nearer(const render::RenderedFrame& part, render::RenderedFrame& whole) {
  for (std::size_t i = 0; i < whole.rgb.pixels.size(); ++i) {
    if (!(std::abs(part.depth_m.pixels[i]) < std::abs(whole.depth_m.pixels[i]))) continue;
    whole.rgb.pixels[i] = part.rgb.pixels[i];
    whole.depth_m.pixels[i] = part.depth_m.pixels[i];
  }
}

/// Renders a frame from some contents, in parts that fit into memory; nullopt: they have no surface in view.
std::optional<render::RenderedFrame> render_contents(CoverageContents& contents, const ContentIds& ids,
                                                     const imaging::Camera& camera, const geometry::SE3& pose) {
  const geometry::Vec3 anchor = contents.bounds(ids).center();
  const tiles::ViewCone view = tiles::view_cones_along(camera, {pose}).front();
  ContentIds visible;
  for (const std::uint32_t id : ids) {
    const geometry::Box3& bounds = contents.facts(id).bounds;
    if (!bounds.isEmpty() && tiles::intersects_cone(view, {bounds.center(), bounds.sizes().norm() / 2}))
      visible.push_back(id);
  }
  std::optional<render::RenderedFrame> whole;
  for (const ContentIds& group : contents.scene_groups(visible)) {
    const scene::Scene scene(contents.meshes(group, true).meshes, anchor);
    render::RenderedFrame part = render::CameraRenderer(scene, camera, {}).render(pose);
    if (whole) {
      merge_nearer(part, *whole);
    } else {
      whole = std::move(part);
    }
  }
  return whole;
}

/// Renders a frame from a strategy's tiles; black where tiles are missing.
imaging::RgbImage render_strategy_picture(CoverageContents& contents, const ContentIds& ids,
                                          const imaging::Camera& camera, const geometry::SE3& pose,
                                          const imaging::FloatImage& true_depth_m) {
  imaging::RgbImage image(camera.width(), camera.height(), {135, 180, 225});
  imaging::FloatImage depth_m(camera.width(), camera.height(), INFINITY);
  if (std::optional<render::RenderedFrame> frame = render_contents(contents, ids, camera, pose)) {
    image = std::move(frame->rgb);
    depth_m = std::move(frame->depth_m);
  }
  for (std::size_t i = 0; i < image.pixels.size(); ++i) {
    if (std::isfinite(true_depth_m.pixels[i]) && !std::isfinite(depth_m.pixels[i])) image.pixels[i] = {0, 0, 0};
  }
  return image;
}

imaging::RgbImage side_by_side(const imaging::RgbImage& left, const imaging::RgbImage& right) {
  constexpr int kGap_px = 8;
  imaging::RgbImage both(left.width + kGap_px + right.width, left.height, {255, 255, 255});
  for (int y = 0; y < left.height; ++y) {
    std::copy_n(left.row(y), left.width, both.row(y));
    std::copy_n(right.row(y), right.width, both.row(y) + left.width + kGap_px);
  }
  return both;
}

void write_pictures(const fs::path& folder, const std::vector<StrategyResult>& all, std::size_t frame,
                    const FrameSampling& watch, CoverageContents& contents, const ContentIds& truth,
                    const CoverageSettings& settings) {
  const imaging::Camera camera = scale_to_width(watch.camera, settings.picture_width);
  imaging::FloatImage depth_m(camera.width(), camera.height(), INFINITY);
  if (auto whole = render_contents(contents, truth, camera, watch.pose(frame))) depth_m = std::move(whole->depth_m);
  std::map<std::string, imaging::RgbImage> pictures;
  for (const StrategyResult& strategy_result : all) {
    const std::string& name = strategy_result.strategy.name;
    pictures[name] =
        render_strategy_picture(contents, strategy_result.tiles_at(frame), camera, watch.pose(frame), depth_m);
    imaging::write_rgb(folder / (name + ".png"), pictures[name]);
  }
  imaging::write_rgb(folder / "figure.png", side_by_side(pictures.at("view-follow"), pictures.at("flight")));
}

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

/// Size of the contents above a cut that a client would also have read while descending from the root.
std::int64_t ancestor_bytes(const ContentIds& cut, const CoverageContents& contents, transport::TileSource& source,
                            tiles::TilesetTree& tree) {
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
                                   const tiles::Placement& placement) {
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

json result_json(const CoverageSettings& settings, const FrameSampling& watch, const std::vector<StrategyResult>& all,
                 const CoverageContents& contents, const ContentIds& truth, const CellCoverage& cells) {
  json result{{"source", transport::redact_source(settings.source)},
              {"flight", settings.flight.string()},
              {"frames", watch.trajectory.size()},
              {"frames_looked_at", watch.frames.size()},
              {"error_px", settings.error_px},
              {"geometric_error_wanted", settings.load.error_m},
              {"tiles_seen", truth.size()},
              {"voxel_size", settings.voxel_m},
              {"voxels_occupied", cells.occupied()},
              {"version", place::version()}};
  for (const StrategyResult& strategy_result : all)
    result["strategies"][strategy_result.strategy.name] = describe(strategy_result, watch, contents);
  return result;
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

nlohmann::json coverage(const CoverageSettings& settings, const fs::path& out, bool replace, const Progress& progress) {
  check(settings);
  base::OutputFolder output{.folder = out,
                            .command = "coverage",
                            .replace = replace,
                            .inputs = vehicle::referenced_files(settings.flight),
                            .legacy = {.key_file = "coverage.json",
                                       .key_text = "strategies",
                                       .files = {"coverage.json", "frames.csv", "figure.png", "view-follow.png",
                                                 "view-high.png", "sensor.png", "flight.png", "region.png"}}};
  output.inputs.push_back(transport::local_path_of_source(settings.source));
  base::require_writable(output);
  const FrameSampling watch = sample_frames(settings);
  const std::unique_ptr<transport::TileSource> source = transport::open_source(settings.source, settings.load.source);
  const std::string name = transport::redact_source(settings.source);
  transport::require_permitted(source->terms(), transport::Use::kAnalyse, settings.load.source.terms_accepted, name);
  tiles::TilesetTree tree(*source);
  tiles::require_supported_extensions(tree.tileset(tree.root()), name);
  const tiles::Placement placement = tiles::resolve_placement(tree, settings.load, name);
  const StrategySettings strategy = strategy_settings(settings, watch, placement);

  CoverageContents contents(*source, tree, placement.T_local_tileset,
                            settings.max_memory_bytes.value_or(place::default_memory_bytes()));
  std::vector<StrategyResult> all = select_tiles(make_tile_strategies(strategy), watch, tree, contents);
  const ContentIds truth = contents.add(tiles::select_cut(tree, full_detail_criterion(strategy)));
  if (truth.empty()) throw InputError(settings.flight.string(), "sees no tile of " + name);
  CellCoverage cells(placement.region, settings.voxel_m, contents.size());
  contents.read_all(
      settings.load.allow_incomplete,
      [&](std::uint32_t id, const tiles::LoadedContent& content) {
        cells.add(id, content);
        contents.reserve(cells.bytes());
      },
      progress);
  require_surface(contents, truth, name);
  FramePixelCounter(watch, contents, truth, tree, settings, progress).count(all);
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

}  // namespace tileflight::survey
