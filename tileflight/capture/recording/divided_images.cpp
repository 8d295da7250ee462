// PartRenderer's images that do not fit into memory whole: checked apart, and rendered in regions or layers.
#include <algorithm>
#include <chrono>
#include <map>
#include <type_traits>
#include <utility>

#include "tileflight/capture/recording/image_division.h"
#include "tileflight/capture/recording/part_renderer.h"
#include "tileflight/capture/render/frame_parts.h"
#include "tileflight/core/base/formatted_text.h"
#include "tileflight/core/base/progress.h"

namespace tileflight::recording {

using imaging::PixelRegion;

namespace {

std::uintmax_t traced_bytes(const PlannedCamera& planned) {
  const render::OutputChannels& outputs = planned.options.outputs;
  const bool has_layers = render::has_one_ray_per_pixel(planned.options);
  const auto if_wanted = [](bool is_wanted, std::uintmax_t bytes) { return is_wanted ? bytes : 0; };
  const std::uintmax_t bytes_per_pixel =
      sizeof(render::LinearRgb) + sizeof(imaging::Rgb8) + if_wanted(planned.options.render.depth, sizeof(float)) +
      if_wanted(outputs.range, sizeof(float)) + if_wanted(outputs.normals, 3 * sizeof(float)) +
      if_wanted(outputs.objects || outputs.placed_objects, sizeof(std::uint32_t)) +
      if_wanted(outputs.flow, 2 * sizeof(float)) + if_wanted(outputs.visibility, 1) +
      if_wanted(has_layers, sizeof(render::LayerSurface));
  const imaging::Camera& camera = planned.calibration.camera;
  return bytes_per_pixel * static_cast<std::uintmax_t>(camera.width()) * static_cast<std::uintmax_t>(camera.height());
}

tileset::MemoryLimitExceeded frame_does_not_fit(const FlightTiles& tiles, std::size_t frame, std::uintmax_t limit) {
  return {tiles.name(),
          base::formatted("the tiles of frame %zu need more than %.3g GB of memory: request coarser tiles "
                          "(--pixel-error, --error), or raise the limit (--memory)",
                          frame, 1e-9 * static_cast<double>(limit))};
}

}  // namespace

/// As load(), of a whole image; if it does not fit beside what its path is checked against, of the image alone.
std::optional<PartRenderer::LoadedPart> PartRenderer::load_whole(std::size_t begin, const FrameAssignment& share,
                                                                 RenderSummary& summary) {
  std::optional<LoadedPart> part = load(begin, share);
  if (part || !may_divide_images(mission_) || loader_->views()[begin].sight == Sight::kPicture) return part;
  check_paths_apart(begin, share, summary);
  if (loader_->estimated_bytes(loader_->views()[begin]) > static_cast<double>(max_memory_bytes_)) return std::nullopt;
  return load(begin, share);
}

/// Checks the path at the image of view `begin`, and at those after it that do not fit into memory either, whose views
/// are then of the pictures alone.
void PartRenderer::check_paths_apart(std::size_t begin, const FrameAssignment& share, RenderSummary& summary) {
  constexpr std::size_t kMostImages = 64;
  const double bytes_for_scene = 0.5 * static_cast<double>(max_memory_bytes_);
  std::vector<std::size_t> checked = too_large_images(begin, kMostImages);
  std::vector<FrameView> views = loader_->views();
  for (std::size_t i = 0; i < checked.size(); ++i) views[begin + i].sight = Sight::kPicture;
  loader_->set_views(std::move(views));
  std::erase_if(checked, [&](std::size_t image) { return !share.is_assigned(image); });
  for (const std::size_t image : checked) path_checks_[image] = {};
  for_each_view(checks_of(checked, bytes_for_scene), static_cast<double>(max_memory_bytes_), share,
                [&](const LoadedPart& part) {
                  const auto start = std::chrono::steady_clock::now();
                  ++summary.parts;
                  for_each_check(
                      part, [&](std::size_t image, const render::PathCheck& check) { path_checks_[image].add(check); });
                  summary.seconds += base::seconds_since(start);
                });
}

/// The image of view `begin`, and those after it, looked at for the same, that do not fit into memory either.
std::vector<std::size_t> PartRenderer::too_large_images(std::size_t begin, std::size_t most) const {
  const std::vector<FrameView>& views = loader_->views();
  std::vector<std::size_t> found{views[begin].frame};
  for (std::size_t i = begin + 1; i < views.size() && found.size() < most; ++i) {
    const bool is_large = loader_->estimated_bytes(views[i]) > static_cast<double>(max_memory_bytes_);
    if (!is_large || views[i].sight != views[begin].sight) break;
    found.push_back(views[i].frame);
  }
  return found;
}

/// The frame of view `begin`, and those after it that do not fit into memory either, as many as are traced together.
std::vector<std::size_t> PartRenderer::frames_to_divide(std::size_t begin) const {
  struct Most {
    std::uintmax_t memory_part;  // of the memory limit, for images that are being traced
    std::size_t frames;
  };
  const std::vector<FrameView>& views = loader_->views();
  if (!may_divide_images(mission_)) throw frame_does_not_fit(*tiles_, views[begin].frame, max_memory_bytes_);
  const bool are_layered = has_layers(views[begin].frame);
  // Layers read each tile once for all images; what regions of different groups share is little.
  const Most most = are_layered ? Most{5, 64} : Most{8, 16};
  const std::vector<std::size_t>& group_of_frame = tiles_->groups().group_of_frame;
  std::vector<std::size_t> frames = too_large_images(
      begin, std::clamp<std::size_t>(max_memory_bytes_ / most.memory_part / bytes_of_traced_frame(), 1, most.frames));
  const auto other = std::ranges::find_if(frames, [&](std::size_t frame) {
    return are_layered ? !has_layers(frame) : group_of_frame[frame] != group_of_frame[frames.front()];
  });
  frames.erase(other, frames.end());
  return frames;
}

/// The same regions of all the images, which are one camera's; those of one region together, so that they share its
/// tiles.
std::vector<FrameView> PartRenderer::divided_views(const std::vector<std::size_t>& frames,
                                                   double bytes_for_tiles) const {
  constexpr double kRegionShare = 0.9;  // estimates may be too low
  const imaging::Camera& camera = camera_of(frames.front()).calibration.camera;
  const std::vector<PixelRegion> regions = divide_image(
      camera.width(), camera.height(),
      [&](const PixelRegion& region) {
        return loader_->estimated_bytes({frames.front(), region, Sight::kPicture});
      },
      kRegionShare * bytes_for_tiles);
  std::vector<FrameView> views;
  for (const PixelRegion& region : regions) {
    for (const std::size_t frame : frames) views.push_back({frame, region, Sight::kPicture});
  }
  return views;
}

/// The layers of one camera's images, those of the same contents together. The first is without contents if anything
/// is placed in the images.
std::vector<ContentRange> PartRenderer::divide_into_layers(const std::vector<std::size_t>& frames,
                                                           double bytes_for_tiles) const {
  constexpr double kLayerShare = 0.75;  // contents that the next image alone needs stay in memory beside the scene
  std::vector<ContentRange> layers = loader_->divide_contents(frames, Sight::kPicture, kLayerShare * bytes_for_tiles);
  if (layers.empty() || camera_of(frames.front()).options.placed) layers.insert(layers.begin(), ContentRange{0, 0});
  return layers;
}

/// The images' layers, those of the same contents together.
std::vector<FrameView> PartRenderer::layers_of(const std::vector<std::size_t>& frames, double bytes_for_tiles) const {
  const std::vector<ContentRange> layers = divide_into_layers(frames, bytes_for_tiles);
  std::vector<FrameView> views;
  for (const ContentRange& layer : layers) {
    for (const std::size_t frame : frames) {
      const FrameView view{frame, {}, Sight::kPicture, layer};
      // Of an image that shows nothing, its first layer is the sky.
      if (layer == layers.front() || loader_->needs_contents(view)) views.push_back(view);
    }
  }
  return views;
}

/// What the images' paths are checked against, those of the same contents together. Its scenes are small: they show
/// what is near.
std::vector<FrameView> PartRenderer::checks_of(const std::vector<std::size_t>& frames, double bytes_for_tiles) const {
  std::vector<FrameView> views;
  for (const ContentRange& contents : loader_->divide_contents(frames, Sight::kPath, bytes_for_tiles)) {
    for (const std::size_t frame : frames) {
      const FrameView view{frame, {}, Sight::kPath, contents};
      if (loader_->needs_contents(view)) views.push_back(view);
    }
  }
  return views;
}

/// Of a part whose views are of the path: passes on what its tiles tell of the camera's path at each image.
void PartRenderer::for_each_check(
    const LoadedPart& part, const std::function<void(std::size_t image, const render::PathCheck& check)>& take) const {
  for (std::size_t i = part.begin; i < part.end; ++i) {
    const std::size_t image = loader_->views()[i].frame;
    const PlannedCamera& camera = camera_of(image);
    take(image, render::check_path(part.scene, camera.frames, images()[image].frame, camera.pose_at,
                                   camera.options.clearance_m, kInsideReach_m));
  }
}

/// Divides what the view that did not fit was to show, for it and the views after it.
void PartRenderer::divide_further(std::size_t begin) {
  loader_->views()[begin].contents ? divide_layer(begin) : divide_region(begin);
}

void PartRenderer::divide_region(std::size_t begin) {
  std::vector<FrameView> views = loader_->views();
  const PixelRegion region = *views[begin].region;
  const std::size_t frame = views[begin].frame;
  const auto halves = halves_of(region, [&](const PixelRegion& half) {
    return loader_->estimated_bytes({frame, half, Sight::kPicture});
  });
  if (!halves) throw frame_does_not_fit(*tiles_, frame, max_memory_bytes_);
  std::vector<FrameView> second;
  std::size_t end = begin;
  for (; end < views.size() && views[end].region == region; ++end) {
    second.push_back({views[end].frame, halves->second, Sight::kPicture});
    views[end].region = halves->first;
  }
  views.insert(views.begin() + static_cast<std::ptrdiff_t>(end), second.begin(), second.end());
  loader_->set_views(std::move(views));
}

void PartRenderer::divide_layer(std::size_t begin) {
  std::vector<FrameView> views = loader_->views();
  const ContentRange layer = *views[begin].contents;
  const Sight sight = views[begin].sight;
  const std::size_t middle = layer.begin + (layer.end - layer.begin) / 2;
  if (middle == layer.begin) throw frame_does_not_fit(*tiles_, views[begin].frame, max_memory_bytes_);
  std::vector<FrameView> second;
  std::size_t end = begin;
  for (; end < views.size() && views[end].contents == layer && views[end].sight == sight; ++end) {
    second.push_back({views[end].frame, {}, sight, ContentRange{middle, layer.end}});
    views[end].contents = {layer.begin, middle};
  }
  views.insert(views.begin() + static_cast<std::ptrdiff_t>(end), second.begin(), second.end());
  loader_->set_views(std::move(views));
}

/// Calls `work` with a scene for each part of the views, which are divided further where they do not fit.
void PartRenderer::for_each_view(std::vector<FrameView> views, double bytes_for_tiles, const FrameAssignment& share,
                                 const PartWork& work) {
  std::vector<FrameView> whole = loader_->views();
  loader_->set_limit(static_cast<std::uintmax_t>(bytes_for_tiles));
  loader_->set_views(std::move(views));
  for (std::size_t next = 0; next < loader_->views().size();) {
    if (std::optional<LoadedPart> part = load(next, share)) {
      loader_->prefetch(part->end);
      work(*part);
      next = release(std::move(*part));
    } else {
      divide_further(next);
    }
  }
  loader_->set_limit(max_memory_bytes_);
  loader_->set_views(std::move(whole));
}

/// Images by their cameras, in the order of each camera's first.
std::vector<std::vector<std::size_t>> PartRenderer::by_camera(const std::vector<std::size_t>& all) const {
  std::map<std::size_t, std::vector<std::size_t>> found;
  for (const std::size_t image : all) found[images()[image].camera].push_back(image);
  std::vector<std::vector<std::size_t>> result;
  for (auto& [camera, of_camera] : found) result.push_back(std::move(of_camera));
  return result;
}

/// As meter_part(), of images that are divided.
std::vector<double> PartRenderer::meter_divided(const std::vector<std::size_t>& all, const FrameAssignment& share) {
  std::map<std::size_t, double> light;
  for (const std::vector<std::size_t>& of_camera : by_camera(all)) {
    if (camera_of(of_camera.front()).options.formation.auto_exposure.target > 0.0)
      light.merge(meter_layers(of_camera, share));
  }
  std::vector<double> means;
  for (const std::size_t image : all) means.push_back(light[image]);
  return means;
}

/// Mean light of one camera's images. The light meter's pixels are of one ray each, whatever the camera's are.
std::map<std::size_t, double> PartRenderer::meter_layers(const std::vector<std::size_t>& of_camera,
                                                         const FrameAssignment& share) {
  const PlannedCamera& camera = camera_of(of_camera.front());
  std::map<std::size_t, render::LayeredFrame> pictures;
  std::map<std::size_t, double> light;
  const double for_tiles = bytes_for_tiles(of_camera.size());
  for_each_view(layers_of(of_camera, for_tiles), for_tiles, share, [&](const LoadedPart& part) {
    const render::FlightRenderOptions options = options_for(part, images()[of_camera.front()].camera, share);
    const render::LightMeter meter = render::make_light_meter(part.scene, camera.calibration.camera, options);
    for (std::size_t i = part.begin; i < part.end; ++i) {
      const FrameView& view = loader_->views()[i];
      render::TracedLayer layer;
      layer.frame.light = meter.layer(camera.frames.poses[images()[view.frame].frame].T_local_camera, layer.surfaces);
      pictures[view.frame].add(std::move(layer), part.mesh_ranks);
    }
    if (part.end < loader_->views().size()) return;
    for (auto& [image, picture] : pictures) light[image] = meter.mean_light(picture.take_frame().light);
  });
  return light;
}

/// Gains of the automatic exposure, for all frames of these images' camera up to the last of them; only those of these
/// are set.
std::vector<double> PartRenderer::gains_of(const std::vector<std::size_t>& of_camera,
                                           const std::map<std::size_t, double>& light, RenderSummary& summary) const {
  const PlannedCamera& camera = camera_of(of_camera.front());
  std::vector<double> times_s, means;
  for (const std::size_t image : of_camera) {
    times_s.push_back(camera.frames.poses[images()[image].frame].time_s);
    means.push_back(light.at(image));
  }
  const std::vector<double> found = render::exposure_gains(camera.options.formation.auto_exposure, times_s, means,
                                                           summary.exposure_after[images()[of_camera.front()].camera]);
  std::vector<double> gains(images()[of_camera.back()].frame + 1, 1.0);
  for (std::size_t k = 0; k < of_camera.size(); ++k) gains[images()[of_camera[k]].frame] = found[k];
  return gains;
}

void PartRenderer::render_divided(const std::vector<std::size_t>& of_camera, FrameAssignment& share,
                                  const CameraFrameSink& sink, RenderSummary& summary) {
  const std::size_t number = images()[of_camera.front()].camera;
  std::vector<double> gains = gains_.empty() ? std::vector<double>() : gains_[number];
  if (gains.empty() && mission_.camera(number).options.formation.auto_exposure.target > 0.0)
    gains = gains_of(of_camera, meter_layers(of_camera, share), summary);
  std::vector<std::size_t> assigned = of_camera;
  std::erase_if(assigned, [&](std::size_t image) { return !share.is_assigned(image); });
  if (assigned.empty()) return;
  summary.frames_divided += static_cast<std::int64_t>(assigned.size());
  const double for_tiles = bytes_for_tiles(assigned.size());
  if (has_layers(assigned.front())) {
    compose<render::LayeredFrame>(assigned, layers_of(assigned, for_tiles), gains, share, sink, summary);
  } else {
    compose<render::DividedFrame>(assigned, divided_views(assigned, for_tiles), gains, share, sink, summary);
  }
  report_progress(progress_, static_cast<std::int64_t>(assigned.back()) + 1,
                  static_cast<std::int64_t>(images().count()), "frames rendered");
}

namespace {

/// Adds a part of a frame's picture.
void add_view(const render::FrameRenderer& renderer, std::size_t index, const FrameView& view,
              std::span<const std::uint32_t>, render::DividedFrame& frame) {
  frame.add(*view.region, renderer.trace_region(index, view.region));
}
void add_view(const render::FrameRenderer& renderer, std::size_t index, const FrameView&,
              std::span<const std::uint32_t> mesh_ranks, render::LayeredFrame& frame) {
  frame.add(renderer.trace_layer(index), mesh_ranks);
}

}  // namespace

/// Renders the views of one camera's images, and hands on the images that they are parts of.
template <class Frame>
void PartRenderer::compose(const std::vector<std::size_t>& of_camera, std::vector<FrameView> views,
                           const std::vector<double>& exposure_gains, FrameAssignment& share,
                           const CameraFrameSink& sink, RenderSummary& summary) {
  const std::size_t number = images()[of_camera.front()].camera;
  const PlannedCamera& camera = mission_.camera(number);
  std::map<std::size_t, Frame> frames;
  for_each_view(std::move(views), bytes_for_tiles(of_camera.size()), share, [&](const LoadedPart& part) {
    const auto start = std::chrono::steady_clock::now();
    ++summary.parts;
    const render::FlightRenderOptions options = options_for(part, of_camera, exposure_gains, share);
    const render::FrameRenderer renderer(part.scene, camera.calibration.camera, camera.frames, camera.pose_at, options);
    for (std::size_t i = part.begin; i < part.end; ++i) {
      const FrameView& view = loader_->views()[i];
      const std::size_t index = images()[view.frame].frame;
      add_view(renderer, index, view, part.mesh_ranks, frames[view.frame]);
    }
    summary.tiles.triangles = std::max(summary.tiles.triangles, static_cast<std::int64_t>(part.scene.triangle_count()));
    if (part.end == loader_->views().size()) {
      for (auto& [image, frame] : frames) {
        frame.add_check(path_checks_.at(image));
        render::TracedFrame traced = frame.take_frame();
        if constexpr (std::is_same_v<Frame, render::LayeredFrame>) renderer.finish_layers(traced, anchor_of(image).z());
        const render::FlightFrame finished = renderer.develop(std::move(traced));
        sink(number, finished);
        share.add(image, finished);
      }
    }
    summary.seconds += base::seconds_since(start);
  });
}

/// What a region's scene may take beside so many frames that are being traced, and one that is written.
double PartRenderer::bytes_for_tiles(std::size_t frames) const {
  // A scene that is being built takes more than it does later; where many scenes follow each other, one will show it.
  constexpr double kTilesShare = 0.7, kLeastShare = 0.4;
  const auto limit = static_cast<double>(max_memory_bytes_);
  const auto images = static_cast<double>((frames + 1) * bytes_of_traced_frame());
  return std::max(kLeastShare * limit, kTilesShare * limit - images);
}

/// Upper bound of what an image takes until it is developed, and as it is written.
std::uintmax_t PartRenderer::bytes_of_traced_frame() const {
  std::uintmax_t most = 0;
  for (std::size_t c = 0; c < mission_.camera_count(); ++c) most = std::max(most, traced_bytes(mission_.camera(c)));
  return most;
}

}  // namespace tileflight::recording
