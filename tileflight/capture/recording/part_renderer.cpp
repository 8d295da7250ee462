#include "tileflight/capture/recording/part_renderer.h"

#include <algorithm>
#include <limits>
#include <nlohmann/json.hpp>
#include <utility>

#include "tileflight/capture/recording/image_division.h"
#include "tileflight/capture/recording/memory_check.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/memory_budget.h"
#include "tileflight/core/base/progress.h"
#include "tileflight/world/place/extract.h"
#include "tileflight/world/place/place_reader.h"

namespace tileflight::recording {
namespace {

namespace fs = std::filesystem;

/// Region of the output `visibility`.
render::RegionPredicate visibility_region_test(const RenderSettings& settings, const tileset::Region& region) {
  if (settings.scored) {
    return [box = *settings.scored](const geometry::Vec3& point) { return box.contains(point); };
  }
  const tileset::LoadOptions& load = settings.load;
  if (!load.center && !load.center_local && !load.size && load.areas.empty()) return {};
  return [region](const geometry::Vec3& point) {
    return region.box().contains(point) &&
           (region.parts.empty() ||
            std::ranges::any_of(region.parts, [&](const auto& part) { return geometry::contains(part, point); }));
  };
}

std::vector<FrameView> views_between(std::size_t begin, std::size_t end, Sight sight = Sight::kBoth) {
  std::vector<FrameView> views;
  for (std::size_t frame = begin; frame < end; ++frame) views.push_back({frame, {}, sight});
  return views;
}

}  // namespace

PartRenderer::PartRenderer(const PlannedFlight& mission, const RenderSettings& settings, const Progress& progress)
    : mission_(mission),
      settings_(settings),
      progress_(progress),
      max_memory_bytes_(settings.max_memory_bytes.value_or(base::default_memory_bytes())) {}

void PartRenderer::select(FrameAssignment& share) {
  tiles_.emplace(mission_, settings_, progress_);
  share.set_cut(tiles_->cut_hash());
}

void PartRenderer::require_fit(const FrameAssignment& share) {
  std::vector<std::size_t> frames;
  for (const FrameView& view : views_to_load(share)) frames.push_back(view.frame);
  const MemoryLimits limits{static_cast<double>(max_memory_bytes_), bytes_for_tiles(1)};
  require_frames_fit(*tiles_, mission_, frames, limits, progress_);
}

std::string PartRenderer::meter(const FrameAssignment& share) {
  if (!has_auto_exposure() || share.has_all_frames()) return "";
  nlohmann::json light = nlohmann::json::array();
  loader_for(views_between(share.metered_begin(), share.end(), Sight::kPicture));
  for (std::size_t next = 0; next < loader_->views().size();) {
    std::vector<double> means;
    if (std::optional<LoadedPart> part = load(next, share)) {
      means = meter_part(*part, share);
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

/// The mean light of the part's images; 0 where a camera has no automatic exposure.
std::vector<double> PartRenderer::meter_part(const LoadedPart& part, const FrameAssignment& share) const {
  std::vector<std::vector<double>> by_camera(mission_.camera_count());
  for (std::size_t c = 0; c < by_camera.size(); ++c) {
    const PlannedCamera& camera = mission_.camera(c);
    const std::size_t frames = frames_in(part, c).size();
    if (frames > 0 && camera.options.formation.auto_exposure.target > 0.0)
      by_camera[c] =
          render::meter_flight(part.scene, camera.calibration.camera, camera.frames, options_for(part, c, share));
    by_camera[c].resize(frames, 0.0);
  }
  std::vector<double> means;
  for (std::size_t view = part.begin; view < part.end; ++view) {
    const ImageId& image = images()[loader_->views()[view].frame];
    means.push_back(by_camera[image.camera][image.frame - frames_in(part, image.camera).begin]);
  }
  return means;
}

void PartRenderer::set_light(const std::vector<std::string>& parts) {
  std::vector<double> all;
  for (const std::string& part : parts) {
    if (part.empty()) return;
    for (const nlohmann::json& mean : nlohmann::json::parse(part)) all.push_back(mean.get<double>());
  }
  std::vector<std::vector<double>> light(mission_.camera_count()), times_s(mission_.camera_count());
  for (std::size_t image = 0; image < all.size(); ++image) {
    const ImageId& id = images()[image];
    light[id.camera].push_back(all[image]);
    times_s[id.camera].push_back(mission_.camera(id.camera).frames.poses[id.frame].time_s);
  }
  gains_.resize(mission_.camera_count());
  for (std::size_t c = 0; c < gains_.size(); ++c) {
    const render::AutoExposure& automatic = mission_.camera(c).options.formation.auto_exposure;
    std::optional<render::AutoExposureState> settled;
    if (automatic.target > 0.0) gains_[c] = render::exposure_gains(automatic, times_s[c], light[c], settled);
  }
}

RenderSummary PartRenderer::run(const fs::path& folder, FrameAssignment& share, const CameraFrameSink& sink) {
  RenderSummary summary;
  summary.exposure_after.resize(mission_.camera_count());
  loader_for(views_to_load(share));
  for (std::size_t next = 0; next < loader_->views().size();) {
    if (std::optional<LoadedPart> part = load_whole(next, share, summary)) {
      loader_->prefetch(part->end);
      render_part(*part, folder, share, sink, summary);
      next = release(std::move(*part));
    } else {
      const std::vector<std::size_t> frames = frames_to_divide(next);
      for (const std::vector<std::size_t>& of_camera : by_camera(frames))
        render_divided(of_camera, share, sink, summary);
      next += frames.size();
    }
    path_checks_.erase(path_checks_.begin(), path_checks_.lower_bound(loader_->views()[next - 1].frame));
  }
  keep_records(share);
  if (!mission_.has_events()) loader_.reset();
  return summary;
}

void PartRenderer::record_events(const std::vector<std::unique_ptr<events::EventRecorder>>& recorders,
                                 const FrameAssignment& share) {
  const auto is_recorded = [](const std::unique_ptr<events::EventRecorder>& recorder) { return recorder != nullptr; };
  const bool is_needed = std::ranges::any_of(recorders, is_recorded);
  if (is_needed) loader_for(views_between(0, images().count()));
  for (std::size_t next = 0; is_needed && next < loader_->views().size();) {
    std::optional<LoadedPart> part = load(next, share);
    if (!part)
      throw InputError("events", "the tiles of image " + std::to_string(next) +
                                     " do not fit into memory together; raise the limit (--memory) or request coarser "
                                     "tiles");
    loader_->prefetch(part->end);
    for (std::size_t c = 0; c < recorders.size(); ++c) {
      if (recorders[c]) record_camera_events(*part, c, share, *recorders[c]);
    }
    next = release(std::move(*part));
    report_progress(progress_, static_cast<std::int64_t>(next), static_cast<std::int64_t>(images().count()),
                    "frames with their events");
  }
  loader_.reset();
}

/// From the part's first frame of the camera to the next part's.
void PartRenderer::record_camera_events(const LoadedPart& part, std::size_t camera, const FrameAssignment& share,
                                        events::EventRecorder& recorder) const {
  const render::FlightRenderOptions options = options_for(part, camera, share);
  const auto first = static_cast<std::int64_t>(loader_->views()[part.begin].frame);
  const std::size_t of_camera = options.end_frame - options.first_frame;
  const auto shown = [&](std::size_t done) {
    const auto images = static_cast<std::int64_t>(part.end - part.begin);
    report_progress(progress_, first + images * static_cast<std::int64_t>(done) / static_cast<std::int64_t>(of_camera),
                    static_cast<std::int64_t>(this->images().count()), "frames with their events");
  };
  try {
    recorder.record({part.scene, render::make_render_options(options), options.placed, part.appearance},
                    options.first_frame, options.end_frame, shown);
  } catch (const InputError& error) {
    const std::string& name = mission_.camera(camera).name;
    if (name.empty()) throw;
    throw InputError("camera " + name, error.what());
  }
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

bool PartRenderer::has_auto_exposure() const {
  for (std::size_t c = 0; c < mission_.camera_count(); ++c) {
    if (mission_.camera(c).options.formation.auto_exposure.target > 0.0) return true;
  }
  return false;
}

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
  if (loader_ && std::ranges::equal(loader_->views(), views, is_same)) {
    loader_->set_views(std::move(views));
  } else {
    loader_.emplace(*tiles_, std::move(views), max_memory_bytes_);
  }
  return *loader_;
}

/// The same for all parts of a group, so that surfaces are bit-identical in each.
const geometry::Vec3& PartRenderer::anchor_of(std::size_t image) const {
  return tiles_->groups().anchors[tiles_->groups().group_of_frame[image]];
}

/// nullopt: the part's first view alone does not fit.
std::optional<PartRenderer::LoadedPart> PartRenderer::load(std::size_t begin, const FrameAssignment& share) {
  std::optional<FlightPart> part = loader_->load(begin, progress_);
  keep_records(share);
  if (!part) return std::nullopt;
  const std::vector<FrameView>& views = loader_->views();
  const FrameView& first = views[part->begin];
  const bool is_whole = !first.region && !first.contents && first.sight == Sight::kBoth;
  if (is_whole && part->end - part->begin == images().count())
    place::require_surface(part->meshes, tiles_->summary().points > 0, tiles_->name());
  LoadedPart loaded{scene::Scene(place::with_placeholder(std::move(part->meshes)), anchor_of(first.frame)), nullptr,
                    part->begin, part->end, std::move(part->places)};
  // One after the other: each takes additional memory while it is built.
  if (first.sight != Sight::kPath) loaded.scene.build_beam_tree();
  if (first.sight != Sight::kPicture) loaded.scene.build_ray_tree();  // else only if a rolling shutter asks for it
  if (first.sight != Sight::kPath && mission_.camera_count() > 1)
    loaded.appearance = std::make_shared<const render::Appearance>(loaded.scene);
  return loaded;
}

/// The camera's frames among the part's images.
jobs::IndexRange PartRenderer::frames_in(const LoadedPart& part, std::size_t camera) const {
  const std::vector<FrameView>& views = loader_->views();
  return images().frames_between(camera, views[part.begin].frame, views[part.end - 1].frame + 1);
}

/// Of all the camera's frames.
render::FlightRenderOptions PartRenderer::options_of(std::size_t camera) const {
  render::FlightRenderOptions options = mission_.camera(camera).options;
  const std::optional<geometry::LocalFrame>& local_frame = tiles_->placement().local_frame;
  if (local_frame) options.origin = local_frame->origin();
  options.inside_reach_m = kInsideReach_m;
  options.scored_region = visibility_region_test(settings_, tiles_->placement().region);
  if (!gains_.empty()) options.exposure_gains = gains_[camera];
  return options;
}

render::FlightRenderOptions PartRenderer::options_for(const LoadedPart& part, std::size_t camera,
                                                      const FrameAssignment& share) const {
  render::FlightRenderOptions options = options_of(camera);
  const jobs::IndexRange frames = frames_in(part, camera);
  options.first_frame = frames.begin;
  options.end_frame = frames.end;
  options.appearance = part.appearance;
  if (share.store() != nullptr) {
    options.frame_filter = [this, camera, &share](std::size_t frame) {
      return share.is_assigned(images().number_of(camera, frame));
    };
  }
  return options;
}

render::FlightRenderOptions PartRenderer::options_for(const LoadedPart& part, const std::vector<std::size_t>& of_camera,
                                                      const std::vector<double>& exposure_gains,
                                                      const FrameAssignment& share) const {
  render::FlightRenderOptions options = options_for(part, images()[of_camera.front()].camera, share);
  if (is_layer_of_tiles(part)) options.placed = {};
  options.exposure_gains = exposure_gains;
  options.first_frame = images()[of_camera.front()].frame;
  options.end_frame = images()[of_camera.back()].frame + 1;
  return options;
}

/// Returns the loader's next view.
std::size_t PartRenderer::release(LoadedPart part) {
  part.appearance.reset();  // it holds the scene's trees
  loader_->take_back(std::move(part.scene).release_meshes());
  return part.end;
}

/// Between the times of the part's first image and the next part's.
void PartRenderer::record_sensors(const LoadedPart& part, const fs::path& folder) const {
  constexpr double kEver = std::numeric_limits<double>::infinity();
  const std::size_t begin = loader_->views()[part.begin].frame, end = loader_->views()[part.end - 1].frame + 1;
  const auto time_s = [&](std::size_t image) {
    const PlannedCamera& camera = camera_of(image);
    return camera.frames.poses[images()[image].frame].time_s + camera.timeshift_s;
  };
  mission_.sensor_recorder->record(part.scene, tiles_->placement().local_frame, begin == 0 ? -kEver : time_s(begin),
                                   end == images().count() ? kEver : time_s(end), folder);
}

void PartRenderer::render_part(const LoadedPart& part, const fs::path& folder, FrameAssignment& share,
                               const CameraFrameSink& sink, RenderSummary& summary) {
  record_sensors(part, folder);
  for (std::size_t c = 0; c < mission_.camera_count(); ++c) {
    const PlannedCamera& camera = mission_.camera(c);
    render::FlightRenderOptions options = options_for(part, c, share);
    if (options.first_frame == options.end_frame) continue;
    options.exposure_before = summary.exposure_after[c];
    if (loader_->views()[part.begin].sight == Sight::kPicture) {
      options.path_check = [this, c](std::size_t frame, render::FrameCheck& check) {
        path_checks_.at(images().number_of(c, frame)).write_to(check);
      };
    }
    const auto take = [&](const render::FlightFrame& frame) {
      sink(c, frame);
      share.add(images().number_of(c, frame.index), frame);
    };
    const render::FlightRenderReport report = render::render_flight(
        part.scene, camera.calibration.camera, camera.frames, camera.pose_at, options, take, progress_of(part, c));
    summary.exposure_after[c] = report.exposure_after;
    summary.seconds += report.seconds;
  }
  summary.tiles.triangles = std::max(summary.tiles.triangles, static_cast<std::int64_t>(part.scene.triangle_count()));
  ++summary.parts;
}

/// Of a rig, all its images are counted: those of the cameras before are done for this part, those of the cameras after
/// are not.
Progress PartRenderer::progress_of(const LoadedPart& part, std::size_t camera) const {
  if (mission_.camera_count() == 1 || !progress_) return progress_;
  std::size_t others = 0;
  for (std::size_t c = 0; c < mission_.camera_count(); ++c) {
    if (c != camera) others += c < camera ? frames_in(part, c).end : frames_in(part, c).begin;
  }
  return [this, others](std::int64_t done, std::int64_t, std::string_view what) {
    const auto images = static_cast<std::int64_t>(this->images().count());
    progress_(std::min(images, static_cast<std::int64_t>(others) + done), images, what);
  };
}

/// What was read is kept before any frame that shows it.
void PartRenderer::keep_records(const FrameAssignment& share) {
  if (share.store() == nullptr) return;
  if (const nlohmann::json records = tiles_->take_new_records(); !records.is_null()) share.store()->add_tiles(records);
}

}  // namespace tileflight::recording
