#include "tileflight/survey/part_renderer.h"

#include <algorithm>
#include <chrono>
#include <map>
#include <nlohmann/json.hpp>
#include <numeric>
#include <utility>

#include "tileflight/base/elapsed_time.h"
#include "tileflight/base/formatted_text.h"
#include "tileflight/place/extract.h"
#include "tileflight/place/memory_budget.h"
#include "tileflight/place/require_surface.h"
#include "tileflight/survey/image_division.h"
#include "tileflight/survey/memory_check.h"

namespace tileflight::survey {
namespace {

namespace fs = std::filesystem;
using imaging::PixelRegion;

/// Region of the output `visibility`.
render::RegionPredicate visibility_region_test(const RenderSettings& settings, const tiles::Region& region) {
  if (settings.scored) {
    return [box = *settings.scored](const geometry::Vec3& point) { return box.contains(point); };
  }
  const tiles::LoadOptions& load = settings.load;
  if (!load.center && !load.center_local && !load.size && load.areas.empty()) return {};
  return [region](const geometry::Vec3& point) {
    return region.box().contains(point) &&
           (region.parts.empty() ||
            std::ranges::any_of(region.parts, [&](const auto& part) { return geometry::contains(part, point); }));
  };
}

std::vector<FrameView> views_between(std::size_t begin, std::size_t end) {
  std::vector<FrameView> views;
  for (std::size_t frame = begin; frame < end; ++frame) views.push_back({frame});
  return views;
}

tiles::MemoryLimitExceeded frame_does_not_fit(const FlightTiles& tiles, std::size_t frame, std::uintmax_t limit) {
  return {tiles.name(),
          base::formatted("the tiles of frame %zu need more than %.3g GB of memory: request coarser tiles "
                          "(--pixel-error, --error), or raise the limit (--memory)",
                          frame, 1e-9 * static_cast<double>(limit))};
}

}  // namespace

PartRenderer::PartRenderer(const PlannedFlight& mission, const RenderSettings& settings, const Progress& progress)
    : mission_(mission),
      settings_(settings),
      progress_(progress),
      max_memory_bytes_(settings.max_memory_bytes.value_or(place::default_memory_bytes())) {}

void PartRenderer::select(FrameAssignment& share) {
  tiles_.emplace(mission_, settings_, progress_);
  share.set_cut(tiles_->cut_hash());
  std::vector<std::size_t> frames;
  for (const FrameView& view : views_to_load(share)) frames.push_back(view.frame);
  const MemoryLimits limits{static_cast<double>(max_memory_bytes_), bytes_for_tiles(1)};
  require_frames_fit(*tiles_, mission_, frames, limits, progress_);
}

std::string PartRenderer::meter(const FrameAssignment& share) {
  if (!has_auto_exposure() || share.has_all_frames()) return "";
  nlohmann::json light = nlohmann::json::array();
  loader_for(views_between(share.metered_begin(), share.end()));
  for (std::size_t next = 0; next < loader_->views().size();) {
    std::vector<double> means;
    if (std::optional<LoadedPart> part = load(next, share)) {
      means = render::meter_flight(part->scene, mission_.calibration.camera, mission_.frames, part->options);
      next = release(std::move(*part));
    } else {
      const std::vector<std::size_t> frames = frames_to_divide(next);
      means = meter_divided(frames, share);
      next += frames.size();
    }
    for (const double mean : means) light.push_back(mean);
  }
  return light.dump();
}

void PartRenderer::set_light(const std::vector<std::string>& parts) {
  std::vector<double> light, times_s;
  for (const std::string& part : parts) {
    if (part.empty()) return;
    for (const nlohmann::json& mean : nlohmann::json::parse(part)) light.push_back(mean.get<double>());
  }
  for (std::size_t i = 0; i < light.size(); ++i) times_s.push_back(mission_.frames.poses[i].time_s);
  std::optional<render::AutoExposureState> settled;
  gains_ = render::exposure_gains(mission_.options.formation.auto_exposure, times_s, light, settled);
}

RenderSummary PartRenderer::run(const fs::path& folder, FrameAssignment& share, const render::FrameSink& sink) {
  RenderSummary summary;
  loader_for(views_to_load(share));
  for (std::size_t next = 0; next < loader_->views().size();) {
    if (std::optional<LoadedPart> part = load(next, share)) {
      loader_->prefetch(part->end);
      part->options.exposure_before = summary.exposure_after;
      render_part(*part, folder, share, sink, summary);
      next = release(std::move(*part));
    } else {
      const std::vector<std::size_t> frames = frames_to_divide(next);
      render_divided(frames, share, sink, summary);
      next += frames.size();
    }
  }
  keep_records(share);
  loader_.reset();
  return summary;
}

void PartRenderer::complete(const FrameAssignment& share, RenderSummary& summary) {
  if (share.store() != nullptr) {
    for (const nlohmann::json& records : share.store()->read_tiles()) tiles_->add_records(records);
  }
  tiles_->read_rest();
  const std::int64_t largest = summary.tiles.triangles;
  summary.tiles = tiles_->summary();
  if (summary.tiles.triangles == 0) place::require_surface({}, summary.tiles.points > 0, tiles_->name());
  summary.tiles.triangles = largest;
}

bool PartRenderer::has_auto_exposure() const { return mission_.options.formation.auto_exposure.target > 0.0; }

bool PartRenderer::is_metered() const { return has_auto_exposure() && gains_.empty(); }

/// The frames to render; all of the range if they are also metered, or other sensors look at the scene.
std::vector<FrameView> PartRenderer::views_to_load(const FrameAssignment& share) const {
  std::vector<FrameView> views = views_between(share.begin(), share.end());
  if (!is_metered() && !mission_.sensor_recorder->suite().needs_scene())
    std::erase_if(views, [&](const FrameView& view) { return !share.is_assigned(view.frame); });
  return views;
}

/// The loader of the step before, with what it has in memory, if it is for the same frames.
PartLoader& PartRenderer::loader_for(std::vector<FrameView> views) {
  const auto is_same = [](const FrameView& a, const FrameView& b) { return a.frame == b.frame; };
  if (!loader_ || !std::ranges::equal(loader_->views(), views, is_same))
    loader_.emplace(*tiles_, std::move(views), max_memory_bytes_);
  return *loader_;
}

/// nullopt: the part's first view alone does not fit.
std::optional<PartRenderer::LoadedPart> PartRenderer::load(std::size_t begin, const FrameAssignment& share) {
  std::optional<FlightPart> part = loader_->load(begin, progress_);
  keep_records(share);
  if (!part) return std::nullopt;
  const std::vector<FrameView>& views = loader_->views();
  const FrameView& first = views[part->begin];
  if (!first.region && part->end - part->begin == mission_.frames.size())
    place::require_surface(part->meshes, tiles_->summary().points > 0, tiles_->name());
  const FrameGroups& groups = tiles_->groups();
  // The same for all parts of a group, so that surfaces are bit-identical in each.
  const geometry::Vec3& anchor = groups.anchors[groups.group_of_frame[first.frame]];
  LoadedPart loaded{scene::Scene(place::with_placeholder(std::move(part->meshes)), anchor), mission_.options,
                    part->begin, part->end};
  // One after the other: each takes additional memory while it is built.
  loaded.scene.build_beam_tree();
  if (first.has_checks) loaded.scene.build_ray_tree();  // else only if a rolling shutter asks for it
  render::FlightRenderOptions& options = loaded.options;
  options.first_frame = first.frame;
  options.end_frame = views[part->end - 1].frame + 1;
  const std::optional<geometry::LocalFrame>& local_frame = tiles_->placement().local_frame;
  if (local_frame) options.origin = local_frame->origin();
  options.scored_region = visibility_region_test(settings_, tiles_->placement().region);
  options.exposure_gains = gains_;
  if (groups.count() > 1 || first.region) options.inside_reach_m = kInsideReach_m;
  if (share.store() != nullptr) options.frame_filter = [&share](std::size_t index) { return share.is_assigned(index); };
  return loaded;
}

/// Returns the loader's next view.
std::size_t PartRenderer::release(LoadedPart part) {
  loader_->take_back(std::move(part.scene).release_meshes());
  return part.end;
}

void PartRenderer::render_part(const LoadedPart& part, const fs::path& folder, FrameAssignment& share,
                               const render::FrameSink& sink, RenderSummary& summary) {
  mission_.sensor_recorder->record(part.scene, tiles_->placement().local_frame, part.options.first_frame,
                                   part.options.end_frame, folder);
  const auto take = [&](const render::FlightFrame& frame) {
    sink(frame);
    share.add(frame);
  };
  const render::FlightRenderReport report = render::render_flight(
      part.scene, mission_.calibration.camera, mission_.frames, mission_.pose_at, part.options, take, progress_);
  summary.exposure_after = report.exposure_after;
  summary.seconds += report.seconds;
  summary.tiles.triangles = std::max(summary.tiles.triangles, static_cast<std::int64_t>(part.scene.triangle_count()));
  ++summary.parts;
}

/// The frame of view `begin`, and those after it that do not fit into memory either, as many as are traced together.
std::vector<std::size_t> PartRenderer::frames_to_divide(std::size_t begin) const {
  constexpr std::uintmax_t kShare = 8;  // of the memory limit, for images that are being traced
  constexpr std::size_t kMost = 16;
  const std::vector<FrameView>& views = loader_->views();
  if (!may_divide_images(mission_)) throw frame_does_not_fit(*tiles_, views[begin].frame, max_memory_bytes_);
  const std::vector<std::size_t>& group_of_frame = tiles_->groups().group_of_frame;
  const std::size_t most = std::clamp<std::size_t>(max_memory_bytes_ / kShare / bytes_of_traced_frame(), 1, kMost);
  std::vector<std::size_t> frames;
  for (std::size_t i = begin; i < views.size() && frames.size() < most; ++i) {
    if (group_of_frame[views[i].frame] != group_of_frame[views[begin].frame]) break;
    const bool is_large = loader_->estimated_bytes(views[i]) > static_cast<double>(max_memory_bytes_);
    if (i > begin && !is_large) break;
    frames.push_back(views[i].frame);
  }
  return frames;
}

/// The same regions of all the frames, those of one region together, so that they share its tiles.
std::vector<FrameView> PartRenderer::divided_views(const std::vector<std::size_t>& frames,
                                                   double bytes_for_tiles) const {
  constexpr double kRegionShare = 0.9;  // estimates may be too low
  const imaging::Camera& camera = mission_.calibration.camera;
  const std::vector<PixelRegion> regions = divide_image(
      camera.width(), camera.height(),
      [&](const PixelRegion& region) {
        return loader_->estimated_bytes({frames.front(), region, false});
      },
      kRegionShare * bytes_for_tiles);
  std::vector<FrameView> views;
  for (const PixelRegion& region : regions) {
    for (const std::size_t frame : frames) views.push_back({frame, region, region == regions.front()});
  }
  return views;
}

/// Halves the region of the view that did not fit, for it and the views of the region after it.
void PartRenderer::divide_further(std::size_t begin) {
  std::vector<FrameView> views = loader_->views();
  const PixelRegion region = *views[begin].region;
  const std::size_t frame = views[begin].frame;
  const auto halves = halves_of(region, [&](const PixelRegion& half) {
    return loader_->estimated_bytes({frame, half, false});
  });
  if (!halves) throw frame_does_not_fit(*tiles_, frame, max_memory_bytes_);
  std::vector<FrameView> second;
  std::size_t end = begin;
  for (; end < views.size() && views[end].region == region; ++end) {
    second.push_back({views[end].frame, halves->second, false});
    views[end].region = halves->first;
  }
  views.insert(views.begin() + static_cast<std::ptrdiff_t>(end), second.begin(), second.end());
  loader_->set_views(std::move(views));
}

/// Calls `work` with a scene for each part of the frames' regions.
void PartRenderer::for_each_region(const std::vector<std::size_t>& frames, const FrameAssignment& share,
                                   const PartWork& work) {
  std::vector<FrameView> whole = loader_->views();
  const double for_tiles = bytes_for_tiles(frames.size());
  loader_->set_limit(static_cast<std::uintmax_t>(for_tiles));
  loader_->set_views(divided_views(frames, for_tiles));
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

std::vector<double> PartRenderer::meter_divided(const std::vector<std::size_t>& frames, const FrameAssignment& share) {
  std::map<std::size_t, render::LinearImage> images;
  std::vector<double> light;
  for_each_region(frames, share, [&](const LoadedPart& part) {
    const render::LightMeter meter = render::make_light_meter(part.scene, mission_.calibration.camera, part.options);
    for (std::size_t i = part.begin; i < part.end; ++i) {
      const FrameView& view = loader_->views()[i];
      const render::LinearImage seen = meter.image(mission_.frames.poses[view.frame].T_local_camera);
      render::LinearImage& image = images.try_emplace(view.frame, seen.width, seen.height).first->second;
      imaging::copy_region(meter.region(*view.region), seen, image);
    }
    if (part.end < loader_->views().size()) return;
    for (const auto& [frame, image] : images) light.push_back(meter.mean_light(image));
  });
  return light;
}

/// Gains of the automatic exposure, for all frames up to the last of these; only those of these are set.
std::vector<double> PartRenderer::gains_of(const std::vector<std::size_t>& frames, const std::vector<double>& light,
                                           RenderSummary& summary) const {
  std::vector<double> times_s;
  for (const std::size_t frame : frames) times_s.push_back(mission_.frames.poses[frame].time_s);
  const std::vector<double> found =
      render::exposure_gains(mission_.options.formation.auto_exposure, times_s, light, summary.exposure_after);
  std::vector<double> gains(frames.back() + 1, 1.0);
  for (std::size_t k = 0; k < frames.size(); ++k) gains[frames[k]] = found[k];
  return gains;
}

void PartRenderer::render_divided(const std::vector<std::size_t>& frames, FrameAssignment& share,
                                  const render::FrameSink& sink, RenderSummary& summary) {
  std::vector<double> gains = gains_;
  if (is_metered()) gains = gains_of(frames, meter_divided(frames, share), summary);
  std::vector<std::size_t> assigned = frames;
  std::erase_if(assigned, [&](std::size_t frame) { return !share.is_assigned(frame); });
  if (assigned.empty()) return;
  summary.frames_divided += static_cast<std::int64_t>(assigned.size());
  std::map<std::size_t, render::DividedFrame> divided;
  for_each_region(assigned, share, [&](const LoadedPart& part) {
    const auto start = std::chrono::steady_clock::now();
    render::FlightRenderOptions options = part.options;
    options.exposure_gains = gains;
    const render::FrameRenderer renderer(part.scene, mission_.calibration.camera, mission_.frames, mission_.pose_at,
                                         options);
    for (std::size_t i = part.begin; i < part.end; ++i) {
      const FrameView& view = loader_->views()[i];
      render::DividedFrame& frame = divided[view.frame];
      frame.add(*view.region, renderer.trace_region(view.frame, view.region));
      if (view.has_checks) renderer.check_path(view.frame, frame.check());
    }
    const auto largest = static_cast<std::int64_t>(part.scene.triangle_count());
    summary.tiles.triangles = std::max(summary.tiles.triangles, largest);
    ++summary.parts;
    if (part.end == loader_->views().size()) {
      for (auto& [index, frame] : divided) {
        const render::FlightFrame finished = renderer.develop(frame.take_frame());
        sink(finished);
        share.add(finished);
      }
    }
    summary.seconds += base::seconds_since(start);
  });
  report_progress(progress_, static_cast<std::int64_t>(assigned.back()) + 1,
                  static_cast<std::int64_t>(mission_.frames.size()), "frames rendered");
}

/// What a region's scene may take beside so many frames that are being traced, and one that is written.
double PartRenderer::bytes_for_tiles(std::size_t frames) const {
  // A scene that is being built takes more than it does later; where many scenes follow each other, one will show it.
  constexpr double kTilesShare = 0.7, kLeastShare = 0.4;
  const auto limit = static_cast<double>(max_memory_bytes_);
  const auto images = static_cast<double>((frames + 1) * bytes_of_traced_frame());
  return std::max(kLeastShare * limit, kTilesShare * limit - images);
}

/// Upper bound of what a frame takes until it is developed, and as it is written.
std::uintmax_t PartRenderer::bytes_of_traced_frame() const {
  const render::OutputChannels& outputs = mission_.options.outputs;
  const auto if_wanted = [](bool is_wanted, std::uintmax_t bytes) { return is_wanted ? bytes : 0; };
  const std::uintmax_t bytes_per_pixel =
      sizeof(render::LinearRgb) + sizeof(imaging::Rgb8) + if_wanted(mission_.options.render.depth, sizeof(float)) +
      if_wanted(outputs.range, sizeof(float)) + if_wanted(outputs.normals, 3 * sizeof(float)) +
      if_wanted(outputs.objects || outputs.placed_objects, sizeof(std::uint32_t)) +
      if_wanted(outputs.flow, 2 * sizeof(float)) + if_wanted(outputs.visibility, 1);
  const imaging::Camera& camera = mission_.calibration.camera;
  return bytes_per_pixel * static_cast<std::uintmax_t>(camera.width()) * static_cast<std::uintmax_t>(camera.height());
}

/// What was read is kept before any frame that shows it.
void PartRenderer::keep_records(const FrameAssignment& share) {
  if (share.store() == nullptr) return;
  if (const nlohmann::json records = tiles_->take_new_records(); !records.is_null()) share.store()->add_tiles(records);
}

}  // namespace tileflight::survey
