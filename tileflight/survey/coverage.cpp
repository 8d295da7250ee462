#include "tileflight/survey/coverage.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <nlohmann/json.hpp>
#include <set>
#include <sstream>

#include "tileflight/base/files.h"
#include "tileflight/base/input_error.h"
#include "tileflight/base/output_folder.h"
#include "tileflight/ground_truth/voxelize.h"
#include "tileflight/imaging/image_files.h"
#include "tileflight/place/require_surface.h"
#include "tileflight/place/version.h"
#include "tileflight/render/camera_renderer.h"
#include "tileflight/survey/tile_coverage.h"
#include "tileflight/survey/tile_strategies.h"
#include "tileflight/tiles/cut_reader.h"
#include "tileflight/transport/open_source.h"
#include "tileflight/vehicle/flight_plan.h"

namespace tileflight::survey {
namespace fs = std::filesystem;
namespace {

using nlohmann::json;
using tiles::CutContent;
using tiles::TileCut;
using ContentIds = std::vector<std::uint32_t>;  ///< content indices, ascending

/// The flight's lens and the sampled poses.
struct FrameSampling {
  imaging::Camera camera;
  geometry::Trajectory trajectory;
  std::vector<std::size_t> frames;  ///< indices into `all`

  const geometry::SE3& pose(std::size_t i) const { return trajectory.poses[frames[i]].T_local_camera; }
};

FrameSampling sample_frames(const CoverageSettings& settings) {
  const vehicle::FlightPlan plan = vehicle::read_flight_plan(settings.flight);
  FrameSampling watch{imaging::read_calibration(plan.camera).camera, vehicle::frame_poses(plan), {}};
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

/// The contents that occur in any cut, once each, and the data read for them.
class ContentPool {
 public:
  ContentIds add(const TileCut& cut) {
    ContentIds ids;
    for (const CutContent& content : cut.contents) {
      const auto [found, is_new] =
          id_of_.try_emplace({content.node, content.content}, static_cast<std::uint32_t>(all_.contents.size()));
      if (is_new) all_.contents.push_back(content);
      ids.push_back(found->second);
    }
    std::sort(ids.begin(), ids.end());
    return ids;
  }

  void read(transport::TileSource& source, const tiles::TilesetTree& tree, const geometry::SE3& T_local_tileset,
            bool allow_incomplete, const Progress& progress) {
    loaded_ = tiles::read_cut(source, tree, all_, T_local_tileset, true, progress);
    for (const tiles::LoadedContent& content : loaded_) {
      if (!content.failure.empty() && !allow_incomplete)
        throw InputError(content.failure, "this tile is needed (--allow-incomplete continues without it)");
    }
  }

  std::size_t size() const { return all_.contents.size(); }
  const CutContent& operator[](std::size_t id) const { return all_.contents[id]; }
  const tiles::LoadedContent& content(std::size_t id) const { return loaded_[id]; }

  bool has_points(const ContentIds& ids) const {
    return std::ranges::any_of(ids, [&](std::uint32_t id) { return !loaded_[id].clouds.empty(); });
  }

  /// The meshes of some contents, and for each mesh its content.
  std::vector<imaging::TexturedMesh> meshes(const ContentIds& ids, std::vector<std::uint32_t>* owner = nullptr) const {
    std::vector<imaging::TexturedMesh> out;
    for (const std::uint32_t id : ids) {
      for (const imaging::TexturedMesh& mesh : loaded_[id].meshes) {
        if (mesh.mesh.triangles.empty()) continue;
        out.push_back(mesh);
        if (owner != nullptr) owner->push_back(id);
      }
    }
    return out;
  }

 private:
  std::map<std::pair<tiles::NodeId, std::size_t>, std::uint32_t> id_of_;
  TileCut all_;
  std::vector<tiles::LoadedContent> loaded_;
};

/// Memory of a decoded content: positions, texture coordinates, triangles, texels.
std::int64_t decoded_bytes(const tiles::LoadedContent& content) {
  std::size_t bytes = 0;
  std::set<const void*> textures;
  for (const imaging::TexturedMesh& mesh : content.meshes) {
    bytes += mesh.mesh.vertices.size() * sizeof(mesh.mesh.vertices[0]) + mesh.colors.size() * sizeof(mesh.colors[0]);
    bytes += mesh.mesh.triangles.size() * sizeof(mesh.mesh.triangles[0]) + mesh.uv.size() * sizeof(mesh.uv[0]);
    if (mesh.texture && textures.insert(mesh.texture.get()).second)
      bytes += mesh.texture->pixels.size() * sizeof(mesh.texture->pixels[0]);
  }
  return static_cast<std::int64_t>(bytes);
}

/// The tiles of a strategy and the resulting counts.
struct StrategyResult {
  TileStrategy strategy;
  std::vector<ContentIds> tiles;    ///< per frame; a single entry if the strategy is fixed
  std::vector<PixelCounts> shares;  ///< per frame
  double cells_share = 0.0;

  const ContentIds& tiles_at(std::size_t frame) const { return tiles[strategy.is_fixed ? 0 : frame]; }
};

/// The region's occupied cells that each content touches.
class CellCoverage {
 public:
  CellCoverage(const ContentPool& contents, const ContentIds& region_cut, const tiles::Region& region, double edge_m)
      : cells_of_(contents.size()) {
    const auto cells = [&](std::uint32_t id) {
      const geometry::TriangleMesh mesh = scene::merge_meshes(contents.content(id).meshes);
      if (mesh.triangles.empty()) return std::vector<geometry::Cell>{};
      geometry::VoxelGrid grid = ground_truth::voxelize(mesh, region.box(), edge_m);
      std::erase_if(grid.occupied, [&](const geometry::Cell& cell) { return is_outside(region, grid.center(cell)); });
      return std::move(grid.occupied);
    };
    for (const std::uint32_t id : region_cut) {
      const std::vector<geometry::Cell> found = cells(id);
      occupied_cells_.insert(occupied_cells_.end(), found.begin(), found.end());
    }
    std::sort(occupied_cells_.begin(), occupied_cells_.end());
    occupied_cells_.erase(std::unique(occupied_cells_.begin(), occupied_cells_.end()), occupied_cells_.end());
    for (std::uint32_t id = 0; id < contents.size(); ++id) {
      for (const geometry::Cell& cell : cells(id)) {
        const auto at = std::lower_bound(occupied_cells_.begin(), occupied_cells_.end(), cell);
        if (at != occupied_cells_.end() && *at == cell)
          cells_of_[id].push_back(static_cast<std::uint32_t>(at - occupied_cells_.begin()));
      }
    }
  }

  std::size_t occupied() const { return occupied_cells_.size(); }

  double share(const ContentIds& ids) const {
    std::vector<bool> found(occupied_cells_.size());
    for (const std::uint32_t id : ids) {
      for (const std::uint32_t cell : cells_of_[id]) found[cell] = true;
    }
    const auto count = std::count(found.begin(), found.end(), true);
    return occupied_cells_.empty() ? 0.0 : static_cast<double>(count) / static_cast<double>(occupied_cells_.size());
  }

 private:
  static bool is_outside(const tiles::Region& region, const geometry::Vec3& center) {
    return !region.parts.empty() &&
           std::ranges::none_of(region.parts, [&](const auto& part) { return contains(part, center); });
  }

  std::vector<geometry::Cell> occupied_cells_;
  std::vector<std::vector<std::uint32_t>> cells_of_;
};

std::vector<StrategyResult> select_tiles(const std::vector<TileStrategy>& strategies, const FrameSampling& watch,
                                         tiles::TilesetTree& tree, ContentPool& contents) {
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

std::vector<bool> nodes_in_memory(const ContentIds& ids, const ContentPool& contents, std::size_t nodes) {
  std::vector<bool> in_memory(nodes);
  for (const std::uint32_t id : ids) in_memory[contents[id].node] = true;
  return in_memory;
}

/// Counts the pixels of each frame for each strategy.
void count_frame_pixels(std::vector<StrategyResult>& all, const FrameSampling& watch, const ContentPool& contents,
                        const ContentIds& truth, const tiles::TilesetTree& tree, const CoverageSettings& settings,
                        const Progress& progress) {
  std::vector<std::uint32_t> owner;
  const scene::Scene scene(contents.meshes(truth, &owner));
  std::vector<std::vector<Substitute>> substitutes(contents.size());
  for (const std::uint32_t id : truth) substitutes[id] = find_substitutes(tree, contents[id]);
  const double pixels_per_rad = tiles::view_cone_of(watch.camera).pixels_per_rad;
  const imaging::Camera camera = scale_to_width(watch.camera, settings.width);
  for (std::size_t i = 0; i < watch.frames.size(); ++i) {
    const std::vector<PixelHit> frame = trace_pixels(scene, owner, camera, watch.pose(i));
    for (StrategyResult& result : all) {
      const std::vector<bool> in_memory = nodes_in_memory(result.tiles_at(i), contents, tree.node_count());
      result.shares.push_back(count_pixels(frame, substitutes, in_memory, pixels_per_rad, settings.error_px));
    }
    report_progress(progress, static_cast<std::int64_t>(i + 1), static_cast<std::int64_t>(watch.frames.size()),
                    "checking frames");
  }
}

std::size_t worst_frame(const StrategyResult& result) {
  const auto missing = [](const PixelCounts& s) { return s.share(s.missing); };
  return static_cast<std::size_t>(std::ranges::max_element(result.shares, {}, missing) - result.shares.begin());
}

/// Renders a frame from a strategy's tiles; black where tiles are missing.
imaging::RgbImage render_strategy_picture(const ContentPool& contents, const ContentIds& ids,
                                          const imaging::Camera& camera, const geometry::SE3& pose,
                                          const imaging::FloatImage& true_depth_m) {
  std::vector<imaging::TexturedMesh> meshes = contents.meshes(ids);
  imaging::RgbImage image(camera.width(), camera.height(), {135, 180, 225});
  imaging::FloatImage depth_m(camera.width(), camera.height(), INFINITY);
  if (!meshes.empty()) {
    const scene::Scene scene(std::move(meshes));
    render::RenderedFrame frame = render::CameraRenderer(scene, camera, {}).render(pose);
    image = std::move(frame.rgb);
    depth_m = std::move(frame.depth_m);
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
                    const FrameSampling& watch, const ContentPool& contents, const ContentIds& truth,
                    const CoverageSettings& settings) {
  const imaging::Camera camera = scale_to_width(watch.camera, settings.picture_width);
  const scene::Scene whole(contents.meshes(truth));
  const imaging::FloatImage depth_m = render::CameraRenderer(whole, camera, {}).render(watch.pose(frame)).depth_m;
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

json describe(const StrategyResult& strategy_result, const FrameSampling& watch, const ContentPool& contents) {
  std::set<std::uint32_t> distinct;
  std::size_t most = 0;
  std::int64_t memory = 0, bytes = 0;
  for (const ContentIds& ids : strategy_result.tiles) {
    std::int64_t at_once = 0;
    for (const std::uint32_t id : ids) at_once += decoded_bytes(contents.content(id));
    memory = std::max(memory, at_once);
    most = std::max(most, ids.size());
    distinct.insert(ids.begin(), ids.end());
  }
  for (const std::uint32_t id : distinct) bytes += contents.content(id).bytes;
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
std::int64_t ancestor_bytes(const ContentIds& cut, const ContentPool& contents, transport::TileSource& source,
                            tiles::TilesetTree& tree) {
  std::set<std::string> uris;
  for (const std::uint32_t id : cut) {
    for (auto above = tree.node(contents[id].node).parent; above; above = tree.node(*above).parent) {
      for (std::size_t c = 0; c < tree.tile(*above).contents.size(); ++c) {
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
                 const ContentPool& contents, const ContentIds& truth, const CellCoverage& cells) {
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

  ContentPool contents;
  std::vector<StrategyResult> all = select_tiles(make_tile_strategies(strategy), watch, tree, contents);
  const ContentIds truth = contents.add(tiles::select_cut(tree, full_detail_criterion(strategy)));
  if (truth.empty()) throw InputError(settings.flight.string(), "sees no tile of " + name);
  contents.read(*source, tree, placement.T_local_tileset, settings.load.allow_incomplete, progress);
  place::require_surface(contents.meshes(truth), contents.has_points(truth), name);
  count_frame_pixels(all, watch, contents, truth, tree, settings, progress);
  const CellCoverage cells(contents, all.back().tiles.front(), placement.region, settings.voxel_m);
  for (StrategyResult& strategy_result : all) {
    for (const ContentIds& ids : strategy_result.tiles)
      strategy_result.cells_share = std::max(strategy_result.cells_share, cells.share(ids));
  }
  json result = result_json(settings, watch, all, contents, truth, cells);
  for (const StrategyResult& strategy_result : all) {
    if (strategy_result.strategy.is_fixed)
      result["strategies"][strategy_result.strategy.name]["bytes_above"] =
          ancestor_bytes(strategy_result.tiles.front(), contents, *source, tree);
  }
  const std::size_t worst = worst_frame(all.front());
  result["picture_frame"] = watch.frames[worst];
  base::write_folder(output, [&](const fs::path& temporary) {
    write_pictures(temporary, all, worst, watch, contents, truth, settings);
    base::write_file(temporary / "frames.csv", frames_csv(all, watch));
    base::write_file(temporary / "coverage.json", result.dump(2) + "\n");
  });
  return result;
}

}  // namespace tileflight::survey
