#include "tileflight/capture/recording/flight_renderer.h"

#include <algorithm>
#include <limits>
#include <nlohmann/json.hpp>
#include <numeric>
#include <utility>

#include "tileflight/capture/recording/content_memory.h"
#include "tileflight/capture/render/frame_renderer.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/memory_budget.h"
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

std::vector<std::size_t> numbers_between(std::size_t begin, std::size_t end) {
  std::vector<std::size_t> numbers(end - begin);
  std::iota(numbers.begin(), numbers.end(), begin);
  return numbers;
}

}  // namespace

FlightRenderer::FlightRenderer(const PlannedFlight& mission, const RenderSettings& settings, FrameAssignment& share,
                               const Progress& progress)
    : mission_(mission),
      settings_(settings),
      share_(share),
      progress_(progress),
      max_memory_bytes_(settings.max_memory_bytes.value_or(base::default_memory_bytes())),
      tiles_(mission, settings, progress),
      exposure_after_(mission.camera_count()) {
  share_.set_cut(tiles_.cut_hash());
}

RenderSummary FlightRenderer::run(const fs::path& folder, const CameraFrameSink& sink) {
  require_frames_fit(tiles_, images_to_load(), max_memory_bytes_, progress_);
  if (has_auto_exposure() && !share_.has_all_frames()) meter();
  RenderSummary summary;
  for_each_part(images_to_load(), Purpose::kImages, [&](const Part& part) {
    record_sensors(part, folder);
    render_part(part, sink, summary);
  });
  if (!mission_.has_events()) loader_.reset();
  summary.tiles_read = tiles_.read_count();
  return summary;
}

/// Calls `work` with one scene after the other, whose images are all of these.
template <class Work>
void FlightRenderer::for_each_part(std::vector<std::size_t> images, Purpose purpose, const Work& work) {
  // The loader of the step before has tiles of the same images in memory.
  if (!loader_ || loader_->images() != images) loader_.emplace(tiles_, std::move(images), max_memory_bytes_);
  for (std::size_t next = 0; next < loader_->images().size();) {
    FlightPart tiles = loader_->load(next, progress_);
    keep_records();
    next = tiles.end;
    Part part = make_part(std::move(tiles), purpose);
    loader_->prefetch(next);
    work(part);
    part.appearance.reset();  // it holds the scene's trees
    loader_->take_back(std::move(part.scene).release_meshes());
  }
}

FlightRenderer::Part FlightRenderer::make_part(FlightPart tiles, Purpose purpose) const {
  const std::size_t begin = loader_->images()[tiles.begin], end = loader_->images()[tiles.end - 1] + 1;
  if (tiles.end - tiles.begin == images().count())
    place::require_surface(tiles.meshes, tiles_.summary().points > 0, tiles_.name(), tiles_.summary().failures);
  // All parts of a group have one anchor, so that surfaces are bit-identical in each.
  const geometry::Vec3& anchor = tiles_.groups().anchors[tiles_.groups().group_of_frame[begin]];
  Part part{scene::Scene(place::with_placeholder(std::move(tiles.meshes)), anchor), nullptr, begin, end};
  // One after the other: each takes additional memory while it is built.
  part.scene.build_beam_tree();
  if (purpose == Purpose::kImages) part.scene.build_ray_tree();  // a light meter seldom needs it
  if (mission_.camera_count() > 1) part.appearance = std::make_shared<const render::Appearance>(part.scene);
  return part;
}

/// The images to render; all of the range if they are also metered, or other sensors look at the scene.
std::vector<std::size_t> FlightRenderer::images_to_load() const {
  std::vector<std::size_t> numbers = numbers_between(share_.begin(), share_.end());
  const bool is_metered = has_auto_exposure() && share_.has_all_frames();
  if (!is_metered && !mission_.sensor_recorder->suite().needs_scene())
    std::erase_if(numbers, [&](std::size_t image) { return !share_.is_assigned(image); });
  return numbers;
}

bool FlightRenderer::has_auto_exposure() const {
  for (std::size_t c = 0; c < mission_.camera_count(); ++c) {
    if (mission_.camera(c).options.formation.auto_exposure.target > 0.0) return true;
  }
  return false;
}

/// The exposure of a frame depends on the light of all frames before it, which other processes render.
void FlightRenderer::meter() {
  std::vector<std::vector<double>> light(mission_.camera_count());
  for_each_part(numbers_between(0, share_.end()), Purpose::kMetering,
                [&](const Part& part) { add_light(part, light); });
  gains_.resize(mission_.camera_count());
  for (std::size_t c = 0; c < gains_.size(); ++c) {
    const PlannedCamera& camera = mission_.camera(c);
    std::vector<double> times_s;
    for (std::size_t i = 0; i < light[c].size(); ++i) times_s.push_back(camera.frames.poses[i].time_s);
    std::optional<render::AutoExposureState> settled;
    const render::AutoExposure& automatic = camera.options.formation.auto_exposure;
    if (automatic.target > 0.0) gains_[c] = render::exposure_gains(automatic, times_s, light[c], settled);
  }
}

/// Appends the mean light of the part's images to that of each camera with an automatic exposure.
void FlightRenderer::add_light(const Part& part, std::vector<std::vector<double>>& light) const {
  for (std::size_t c = 0; c < light.size(); ++c) {
    const PlannedCamera& camera = mission_.camera(c);
    const render::FlightRenderOptions options = options_for(part, c);
    if (options.first_frame == options.end_frame || camera.options.formation.auto_exposure.target <= 0.0) continue;
    const std::vector<double> means =
        render::meter_flight(part.scene, camera.calibration.camera, camera.frames, options);
    light[c].insert(light[c].end(), means.begin(), means.end());
  }
}

render::FlightRenderOptions FlightRenderer::options_for(const Part& part, std::size_t camera) const {
  render::FlightRenderOptions options = mission_.camera(camera).options;
  const std::optional<geometry::LocalFrame>& local_frame = tiles_.placement().local_frame;
  if (local_frame) options.origin = local_frame->origin();
  render::light_by_relief(tiles_.lacks_textures(), options.formation);
  options.inside_reach_m = kInsideReach_m;
  options.scored_region = visibility_region_test(settings_, tiles_.placement().region);
  if (!gains_.empty()) options.exposure_gains = gains_[camera];
  const jobs::IndexRange frames = images().frames_between(camera, part.begin, part.end);
  options.first_frame = frames.begin;
  options.end_frame = frames.end;
  options.appearance = part.appearance;
  if (share_.store() != nullptr) {
    options.frame_filter = [this, camera](std::size_t frame) {
      return share_.is_assigned(images().number_of(camera, frame));
    };
  }
  return options;
}

void FlightRenderer::render_part(const Part& part, const CameraFrameSink& sink, RenderSummary& summary) {
  for (std::size_t c = 0; c < mission_.camera_count(); ++c) {
    const PlannedCamera& camera = mission_.camera(c);
    render::FlightRenderOptions options = options_for(part, c);
    if (options.first_frame == options.end_frame) continue;
    options.exposure_before = exposure_after_[c];
    const auto take = [&](const render::FlightFrame& frame) {
      sink(c, frame);
      share_.add(images().number_of(c, frame.index), frame);
    };
    const render::FlightRenderReport report = render::render_flight(
        part.scene, camera.calibration.camera, camera.frames, camera.pose_at, options, take, progress_of(part, c));
    exposure_after_[c] = report.exposure_after;
    summary.seconds += report.seconds;
  }
  summary.tiles.triangles = std::max(summary.tiles.triangles, static_cast<std::int64_t>(part.scene.triangle_count()));
  ++summary.parts;
}

/// Counts all images of a rig: those of the cameras before are done for this part, those of the cameras after are not.
Progress FlightRenderer::progress_of(const Part& part, std::size_t camera) const {
  if (mission_.camera_count() == 1 || !progress_) return progress_;
  std::size_t others = 0;
  for (std::size_t c = 0; c < mission_.camera_count(); ++c) {
    const jobs::IndexRange frames = images().frames_between(c, part.begin, part.end);
    if (c != camera) others += c < camera ? frames.end : frames.begin;
  }
  return [this, others](std::int64_t done, std::int64_t, std::string_view what) {
    const auto all = static_cast<std::int64_t>(images().count());
    progress_(std::min(all, static_cast<std::int64_t>(others) + done), all, what);
  };
}

/// Records between the times of the part's first image and the next part's.
void FlightRenderer::record_sensors(const Part& part, const fs::path& folder) const {
  constexpr double kEver = std::numeric_limits<double>::infinity();
  const auto time_s = [&](std::size_t image) {
    const PlannedCamera& camera = mission_.camera(images()[image].camera);
    return camera.frames.poses[images()[image].frame].time_s + camera.timeshift_s;
  };
  mission_.sensor_recorder->record(part.scene, tiles_.placement().local_frame,
                                   part.begin == 0 ? -kEver : time_s(part.begin),
                                   part.end == images().count() ? kEver : time_s(part.end), folder);
}

void FlightRenderer::record_events(const std::vector<std::unique_ptr<events::EventRecorder>>& recorders) {
  for_each_part(numbers_between(0, images().count()), Purpose::kImages, [&](const Part& part) {
    for (std::size_t c = 0; c < recorders.size(); ++c) {
      if (recorders[c]) record_camera_events(part, c, *recorders[c]);
    }
    report_progress(progress_, static_cast<std::int64_t>(part.end), static_cast<std::int64_t>(images().count()),
                    "frames with their events");
  });
  loader_.reset();
}

/// Records from the part's first frame of the camera to the next part's.
void FlightRenderer::record_camera_events(const Part& part, std::size_t camera, events::EventRecorder& recorder) const {
  const render::FlightRenderOptions options = options_for(part, camera);
  const std::size_t of_camera = options.end_frame - options.first_frame;
  const auto shown = [&](std::size_t done) {
    report_progress(progress_, static_cast<std::int64_t>(part.begin + (part.end - part.begin) * done / of_camera),
                    static_cast<std::int64_t>(images().count()), "frames with their events");
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

void FlightRenderer::complete(RenderSummary& summary) {
  if (share_.store() != nullptr) {
    for (const nlohmann::json& records : share_.store()->read_tiles()) tiles_.add_records(records);
  }
  tiles_.read_rest();
  const std::int64_t largest = summary.tiles.triangles;
  summary.tiles = tiles_.summary();
  if (summary.tiles.triangles == 0)
    place::require_surface({}, summary.tiles.points > 0, tiles_.name(), summary.tiles.failures);
  summary.tiles.triangles = largest;
  summary.lacks_textures = tiles_.lacks_textures();
}

/// Keeps what was read before any frame that shows it.
void FlightRenderer::keep_records() {
  if (share_.store() == nullptr) return;
  if (const nlohmann::json records = tiles_.take_new_records(); !records.is_null()) share_.store()->add_tiles(records);
}

}  // namespace tileflight::recording
