#include "tileflight/capture/preview/strategy_result.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <optional>
#include <string>

#include "tileflight/capture/render/camera_renderer.h"
#include "tileflight/core/imaging/image_files.h"
#include "tileflight/tiles/tileset/view_cone_tree.h"
#include "tileflight/world/scene/scene.h"

namespace tileflight::preview {

namespace {

using geometry::Mat3;
using geometry::SE3;
using geometry::Vec3;
using tileset::RefinementCriterion;

constexpr double kMaxPinholeFov_deg = 170.0;

/// Camera pose that looks straight down, with north at the top of the image.
SE3 nadir_pose(const Vec3& from) {
  Mat3 r;
  r << 1, 0, 0, 0, -1, 0, 0, 0, -1;
  return {r, from};
}

/// A pose above the region's centre at the lowest height at which the region's top fills the view.
SE3 overview_pose(const StrategySettings& s) {
  const double tan_x = std::tan(s.viewer.horizontal_fov_deg * std::numbers::pi / 360.0);
  const double tan_y = tan_x * s.viewer.height / s.viewer.width;
  const double above_m = std::max(s.region.size.x() / 2 / tan_x, s.region.size.y() / 2 / tan_y);
  return nadir_pose(s.region.center + Vec3(0, 0, s.region.size.z() / 2 + above_m));
}

/// The flight's own lens as a viewer's camera.
tileset::ViewerCamera sensor_viewer(const StrategySettings& s) {
  tileset::ViewerCamera viewer = s.viewer;
  viewer.width = s.camera.width();
  viewer.height = s.camera.height();
  viewer.horizontal_fov_deg = std::min(s.camera.horizontal_fov_deg(), kMaxPinholeFov_deg);
  return viewer;
}

RefinementCriterion criterion_from_pose(tileset::ViewerCamera viewer, const SE3& pose, const StrategySettings& s) {
  viewer.T_local_camera = pose;
  return limit_refinement(viewer_criterion(viewer, s.T_local_tileset), s.error_m);
}

}  // namespace

std::vector<TileStrategy> make_tile_strategies(const StrategySettings& s) {
  const auto above_drone = [s](const SE3& pose) {
    return criterion_from_pose(s.viewer, nadir_pose(pose.translation + Vec3(0, 0, s.follow_height_m)), s);
  };
  const RefinementCriterion high = criterion_from_pose(s.viewer, overview_pose(s), s);
  const RefinementCriterion flight = limit_refinement(
      tileset::flight_criterion(tileset::view_cones_along(s.camera, s.T_local_camera), s.T_local_tileset, s.error_px),
      s.error_m);
  const RefinementCriterion region = tileset::region_criterion(s.region, s.T_local_tileset, s.error_m);
  return {
      {"view-follow", "a viewer's camera above the drone, looking down", false, above_drone},
      {"view-high", "a viewer's camera high above the region", true, [high](const SE3&) { return high; }},
      {"sensor", "a viewer with the sensor's own view", false,
       [s](const SE3& pose) { return criterion_from_pose(sensor_viewer(s), pose, s); }},
      {"flight", "one set of tiles for all frames, by screen-space error", true,
       [flight](const SE3&) { return flight; }},
      {"region", "one set of tiles for the region, by geometric error", true, [region](const SE3&) { return region; }}};
}

RefinementCriterion full_detail_criterion(const StrategySettings& s) {
  return limit_refinement(
      tileset::flight_criterion(tileset::view_cones_along(s.camera, s.T_local_camera), s.T_local_tileset, 0.0),
      s.error_m);
}

namespace {

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
  const tileset::ViewCone view = tileset::view_cones_along(camera, {pose}).front();
  ContentIds visible;
  for (const std::uint32_t id : ids) {
    const geometry::Box3& bounds = contents.facts(id).bounds;
    if (!bounds.isEmpty() && tileset::intersects_cone(view, {bounds.center(), bounds.sizes().norm() / 2}))
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

}  // namespace

void write_pictures(const std::filesystem::path& folder, const std::vector<StrategyResult>& all, std::size_t frame,
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

namespace {

std::vector<bool> nodes_in_memory(const ContentIds& ids, const CoverageContents& contents, std::size_t nodes) {
  std::vector<bool> in_memory(nodes);
  for (const std::uint32_t id : ids) in_memory[contents[id].node] = true;
  return in_memory;
}

class FramePixelCounter {
 public:
  FramePixelCounter(const FrameSampling& watch, CoverageContents& contents, const ContentIds& truth,
                    const tileset::TilesetTree& tree, const CoverageSettings& settings, const Progress& progress)
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
    const tileset::ViewCone lens = tileset::view_cone_of(watch_.camera);
    for (std::size_t k = 0; k < parts_.size(); ++k) {
      CoverageContents::OwnedMeshes meshes = contents_.meshes(parts_[k], false);
      const scene::Scene part(std::move(meshes.meshes), anchor_);
      const geometry::Box3& bounds = part.bounds();
      for (std::size_t i = begin; i < end; ++i) {
        tileset::ViewCone view = lens;
        view.position = watch_.pose(i).translation;
        view.axis = watch_.pose(i).rotation * geometry::Vec3::UnitZ();
        if (!tileset::intersects_cone(view, {bounds.center(), bounds.sizes().norm() / 2})) continue;
        trace_pixels(part, meshes.content_of_mesh, rays_, watch_.pose(i), hits[i - begin]);
      }
      // One more part of one of the groups of frames is done.
      const double done = static_cast<double>(begin) * static_cast<double>(parts_.size()) +
                          static_cast<double>((end - begin) * (k + 1));
      report_progress(progress_, std::llround(done / static_cast<double>(parts_.size())),
                      static_cast<std::int64_t>(watch_.frames.size()), "checking frames");
    }
    return hits;
  }

  void count_frame(std::size_t i, const std::vector<PixelHit>& frame, std::vector<StrategyResult>& all) const {
    const double pixels_per_rad = tileset::view_cone_of(watch_.camera).pixels_per_rad;
    for (StrategyResult& result : all) {
      const std::vector<bool> in_memory = nodes_in_memory(result.tiles_at(i), contents_, tree_.node_count());
      result.shares.push_back(count_pixels(frame, substitutes_, in_memory, pixels_per_rad, settings_.error_px));
    }
  }

  const FrameSampling& watch_;
  CoverageContents& contents_;
  const tileset::TilesetTree& tree_;
  const CoverageSettings& settings_;
  const Progress& progress_;
  std::vector<std::optional<geometry::Vec3>> rays_;
  std::vector<ContentIds> parts_;
  geometry::Vec3 anchor_;
  std::vector<std::vector<Substitute>> substitutes_;
};

}  // namespace

std::size_t worst_frame(const StrategyResult& result) {
  const auto missing = [](const PixelCounts& s) { return s.share(s.missing); };
  return static_cast<std::size_t>(std::ranges::max_element(result.shares, {}, missing) - result.shares.begin());
}

void count_pixels_of_frames(const FrameSampling& watch, CoverageContents& contents, const ContentIds& truth,
                            const tileset::TilesetTree& tree, const CoverageSettings& settings,
                            const Progress& progress, std::vector<StrategyResult>& all) {
  FramePixelCounter(watch, contents, truth, tree, settings, progress).count(all);
}

}  // namespace tileflight::preview
