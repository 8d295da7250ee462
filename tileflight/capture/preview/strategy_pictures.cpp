#include "tileflight/capture/preview/strategy_pictures.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <optional>
#include <string>

#include "tileflight/core/imaging/image_files.h"
#include "tileflight/capture/render/camera_renderer.h"
#include "tileflight/tiles/tileset/view_cone_tree.h"

namespace tileflight::preview {
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

}  // namespace tileflight::preview
