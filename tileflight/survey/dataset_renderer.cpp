#include "tileflight/survey/dataset_renderer.h"

#include <algorithm>
#include <map>
#include <mutex>
#include <nlohmann/json.hpp>
#include <numeric>

#include "tileflight/base/elapsed_time.h"
#include "tileflight/base/files.h"
#include "tileflight/base/input_error.h"
#include "tileflight/base/string_lists.h"
#include "tileflight/dataset/attitude_csv.h"
#include "tileflight/dataset/encode_queue.h"
#include "tileflight/dataset/video.h"
#include "tileflight/imaging/photometric.h"
#include "tileflight/place/extract.h"
#include "tileflight/place/memory_budget.h"
#include "tileflight/place/require_surface.h"
#include "tileflight/place/version.h"
#include "tileflight/scene/scene.h"
#include "tileflight/sensors/gnss.h"
#include "tileflight/survey/flight_faults.h"
#include "tileflight/survey/flight_tiles.h"
#include "tileflight/survey/frame_output_writer.h"
#include "tileflight/survey/memory_check.h"
#include "tileflight/survey/part_loader.h"
#include "tileflight/transport/open_source.h"

namespace tileflight::survey {
namespace fs = std::filesystem;
namespace {

/// Simulated receiver positions along the path, if the place is georeferenced.
std::vector<dataset::GpsFix> simulate_gps(const PlannedFlight& mission,
                                          const std::optional<geometry::LocalFrame>& frame, std::uint64_t seed) {
  if (!frame || mission.frames.size() < 2) return {};
  std::vector<dataset::GpsFix> fixes;
  const sensors::GnssOptions options =
      mission.sensor_recorder->suite().gnss.value_or(sensors::GnssOptions{.seed = seed});
  for (const sensors::GnssFix& fix : sensors::simulate_gnss(mission.frames, options)) {
    fixes.push_back(
        {fix.time_s, frame->geodetic_from_local(fix.position), fix.horizontal_sigma_m, fix.vertical_sigma_m});
  }
  return fixes;
}

/// Simulated gimbal measurements of the camera's attitude, if the place is georeferenced.
std::vector<dataset::CameraAttitude> simulate_camera_attitude(const PlannedFlight& mission,
                                                              const std::optional<geometry::LocalFrame>& frame,
                                                              std::uint64_t seed) {
  if (!frame || mission.frames.size() < 2) return {};
  const sensors::AttitudeOptions options =
      mission.sensor_recorder->suite().attitude.value_or(sensors::AttitudeOptions{.seed = seed});
  const auto times = render::make_sample_times("attitude", mission.frames.poses.front().time_s,
                                               mission.frames.poses.back().time_s, options.rate_hz);
  const auto pose_at = [&](double time_s) { return *geometry::interpolate(mission.frames, time_s); };
  std::vector<dataset::CameraAttitude> attitudes;
  for (const sensors::AttitudeSample& sample : sensors::simulate_attitude(pose_at, times, options))
    attitudes.push_back(
        {sample.time_s, sample.R_local_camera, sensors::tilt_sigma_deg(options), sensors::yaw_sigma_deg(options)});
  return attitudes;
}

std::map<std::string, std::string> description(const RenderSettings& settings, const tiles::LoadedTiles& tiles) {
  return {{"made_by", "tileflight render " + place::version()},
          {"source", transport::redact_source(settings.source)},
          {"flight", settings.flight.flight.string()},
          {"seed", std::to_string(settings.seed)},
          {"cut_sha256", tiles.cut_hash},
          {"tiles", std::to_string(tiles.cut_size - tiles.tiles_failed)},
          {"attribution", base::joined(tiles.attribution, "; ")},
          {"terms_provider", tiles.terms.provider},
          {"terms_accepted", settings.load.source.terms_accepted ? "true" : "false"}};
}

/// Frames arrive from several threads in any order; a video needs them in sequence.
class FrameReorderBuffer {
 public:
  explicit FrameReorderBuffer(std::function<void(const imaging::RgbImage&)> take) : sink_(std::move(take)) {}

  void add(std::size_t index, const imaging::RgbImage& image) {
    const std::lock_guard lock(mutex_);
    waiting_.emplace(index, image);
    for (auto next = waiting_.find(next_); next != waiting_.end(); next = waiting_.find(next_)) {
      sink_(next->second);
      waiting_.erase(next);
      ++next_;
    }
  }

 private:
  std::function<void(const imaging::RgbImage&)> sink_;
  std::mutex mutex_;
  std::map<std::size_t, imaging::RgbImage> waiting_;
  std::size_t next_ = 0;
};

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

/// Loads a flight's tiles and renders its frames, in as many parts as the memory limit requires. The steps are called
/// in order.
class PartRenderer {
 public:
  PartRenderer(const PlannedFlight& mission, const RenderSettings& settings, const Progress& progress)
      : mission_(mission),
        settings_(settings),
        progress_(progress),
        max_memory_bytes_(settings.max_memory_bytes.value_or(place::default_memory_bytes())) {}

  /// Selects the tiles, and with them the frames that remain; refuses those that do not fit into memory.
  void select(FrameAssignment& share) {
    tiles_.emplace(mission_, settings_, progress_);
    share.set_cut(tiles_->cut_hash());
    require_frames_fit(*tiles_, frames_to_load(share), max_memory_bytes_, progress_);
  }

  /// Light of the frames in this rank's range (of a part: also of all before it, which no other process meters), for
  /// set_light(); empty if the rank needs none of other ranks' frames.
  std::string meter(const FrameAssignment& share) {
    if (!has_auto_exposure() || share.has_all_frames()) return "";
    nlohmann::json light = nlohmann::json::array();
    PartLoader& loader = loader_for(frames_between(share.metered_begin(), share.end()));
    for (std::size_t next = 0; next < loader.frames().size();) {
      LoadedPart part = load(loader, next, share);
      for (const double mean : meter_flight(part.scene, mission_.calibration.camera, mission_.frames, part.options))
        light.push_back(mean);
      next = release(std::move(part), loader);
    }
    return light.dump();
  }

  /// `parts`: results of meter(), by rank.
  void set_light(const std::vector<std::string>& parts) {
    std::vector<double> light, times_s;
    for (const std::string& part : parts) {
      if (part.empty()) return;
      for (const nlohmann::json& mean : nlohmann::json::parse(part)) light.push_back(mean.get<double>());
    }
    for (std::size_t i = 0; i < light.size(); ++i) times_s.push_back(mission_.frames.poses[i].time_s);
    std::optional<render::AutoExposureState> settled;
    gains_ = render::exposure_gains(mission_.options.formation.auto_exposure, times_s, light, settled);
  }

  /// Frames of `share` are passed to `sink`, which must have written a frame's files when it returns. `folder`: the
  /// dataset's, for the data of other sensors.
  RenderSummary run(const fs::path& folder, FrameAssignment& share, const render::FrameSink& sink) {
    RenderSummary summary;
    PartLoader& loader = loader_for(frames_to_load(share));
    for (std::size_t next = 0; next < loader.frames().size();) {
      LoadedPart part = load(loader, next, share);
      loader.prefetch(part.end);
      part.options.exposure_before = summary.exposure_after;
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
      summary.tiles.triangles =
          std::max(summary.tiles.triangles, static_cast<std::int64_t>(part.scene.triangle_count()));
      ++summary.parts;
      next = release(std::move(part), loader);
    }
    keep_records(share);
    loader_.reset();
    return summary;
  }

  /// Completes the summary by what all processes read; on the first rank. Throws InputError if no tile has a surface.
  void complete(const FrameAssignment& share, RenderSummary& summary) {
    if (share.store() != nullptr) {
      for (const nlohmann::json& records : share.store()->read_tiles()) tiles_->add_records(records);
    }
    tiles_->read_rest();
    const std::int64_t largest = summary.tiles.triangles;
    summary.tiles = tiles_->summary();
    if (summary.tiles.triangles == 0) place::require_surface({}, summary.tiles.points > 0, tiles_->name());
    summary.tiles.triangles = largest;
  }

 private:
  struct LoadedPart {
    scene::Scene scene;
    render::FlightRenderOptions options;
    std::size_t end = 0;  ///< index into the loader's frames
  };

  bool has_auto_exposure() const { return mission_.options.formation.auto_exposure.target > 0.0; }

  static std::vector<std::size_t> frames_between(std::size_t begin, std::size_t end) {
    std::vector<std::size_t> frames(end - begin);
    std::iota(frames.begin(), frames.end(), begin);
    return frames;
  }

  /// The frames to render; all of the range if they are also metered, or other sensors look at the scene.
  std::vector<std::size_t> frames_to_load(const FrameAssignment& share) const {
    std::vector<std::size_t> frames = frames_between(share.begin(), share.end());
    const bool is_metered = has_auto_exposure() && gains_.empty();
    if (!is_metered && !mission_.sensor_recorder->suite().needs_scene())
      std::erase_if(frames, [&](std::size_t frame) { return !share.is_assigned(frame); });
    return frames;
  }

  /// The loader of the step before, with what it has in memory, if it is for the same frames.
  PartLoader& loader_for(std::vector<std::size_t> frames) {
    if (!loader_ || loader_->frames() != frames) loader_.emplace(*tiles_, std::move(frames), max_memory_bytes_);
    return *loader_;
  }

  LoadedPart load(PartLoader& loader, std::size_t begin, const FrameAssignment& share) {
    FlightPart part = loader.load(begin, progress_);
    keep_records(share);
    const std::vector<std::size_t>& frames = loader.frames();
    if (part.end - part.begin == mission_.frames.size())
      place::require_surface(part.meshes, tiles_->summary().points > 0, tiles_->name());
    const FrameGroups& groups = tiles_->groups();
    // The same for all parts of a group, so that surfaces are bit-identical in each.
    const geometry::Vec3& anchor = groups.anchors[groups.group_of_frame[frames[part.begin]]];
    LoadedPart loaded{scene::Scene(place::with_placeholder(std::move(part.meshes)), anchor), mission_.options,
                      part.end};
    // One after the other: each takes additional memory while it is built.
    loaded.scene.build_beam_tree();
    loaded.scene.build_ray_tree();
    render::FlightRenderOptions& options = loaded.options;
    options.first_frame = frames[part.begin];
    options.end_frame = frames[part.end - 1] + 1;
    const std::optional<geometry::LocalFrame>& local_frame = tiles_->placement().local_frame;
    if (local_frame) options.origin = local_frame->origin();
    options.scored_region = visibility_region_test(settings_, tiles_->placement().region);
    options.exposure_gains = gains_;
    if (groups.count() > 1) options.inside_reach_m = kInsideReach_m;
    if (share.store() != nullptr)
      options.frame_filter = [&share](std::size_t index) { return share.is_assigned(index); };
    return loaded;
  }

  /// Returns the loader's next frame.
  static std::size_t release(LoadedPart part, PartLoader& loader) {
    loader.take_back(std::move(part.scene).release_meshes());
    return part.end;
  }

  /// What was read is kept before any frame that shows it.
  void keep_records(const FrameAssignment& share) {
    if (share.store() == nullptr) return;
    if (const nlohmann::json records = tiles_->take_new_records(); !records.is_null())
      share.store()->add_tiles(records);
  }

  const PlannedFlight& mission_;
  const RenderSettings& settings_;
  const Progress& progress_;
  std::uintmax_t max_memory_bytes_;
  std::optional<FlightTiles> tiles_;
  std::optional<PartLoader> loader_;
  std::vector<double>
      gains_;  ///< of the automatic exposure, for all frames up to this process's last; empty: not known yet, or none
};

/// Writes the inverse of the camera's response, and its vignetting.
void write_photometric(const PlannedFlight& mission, const fs::path& folder) {
  const imaging::Camera& camera = mission.calibration.camera;
  const imaging::PhotometricCalibration calibration =
      render::photometric_calibration(mission.options.formation, camera.width(), camera.height());
  imaging::write_pcalib(folder / "pcalib.txt", calibration.inverse_response);
  if (!calibration.vignette.empty()) imaging::write_vignette(folder / "vignette.png", calibration.vignette);
}

/// Writes the dataset's metadata.
void write_metadata(dataset::DatasetWriter& writer, const PlannedFlight& mission, const RenderSettings& settings,
                    const RenderSummary& summary, const std::vector<FrameRecord>& frames) {
  if (settings.flight.outputs.photometric) write_photometric(mission, writer.temporary_folder());
  writer.set_groundtruth(mission.frames);
  const std::vector<dataset::GpsFix> gps = simulate_gps(mission, summary.tiles.local_frame, settings.seed);
  if (!gps.empty()) writer.set_gps(gps);
  const auto attitudes = simulate_camera_attitude(mission, summary.tiles.local_frame, settings.seed);
  if (!attitudes.empty()) dataset::write_attitude_csv(writer.temporary_folder() / "attitude.csv", attitudes);
  for (const auto& [key, value] : description(settings, summary.tiles)) writer.describe(key, value);
  const std::optional<geometry::LocalFrame>& frame = summary.tiles.local_frame;
  for (const auto& [key, value] : place::describe_frame(frame ? std::optional(frame->origin()) : std::nullopt))
    writer.describe(key, value);
  const auto faults = render::find_flight_faults(frame_checks(frames), 0, mission.options.clearance_m);
  for (const auto& [key, value] : faults_to_metadata(faults)) writer.describe(key, value);
  if (const auto& light = mission.options.formation.light)
    writer.describe("light", describe_sun_position(make_daylight(*light, summary.tiles.local_frame->origin())->sun()));
  mission.sensor_recorder->write(summary.tiles.local_frame, mission.frames.poses.front().time_s,
                                 writer.temporary_folder());
  for (const auto& [key, value] : mission.sensor_recorder->description()) writer.describe(key, value);
  if (!mission.vehicle.is_null()) {
    base::write_file(writer.temporary_folder() / "vehicle.json", mission.vehicle.dump(2) + "\n");
  }
}

double frame_rate(const geometry::Trajectory& frames) {
  if (frames.size() < 2) return 30.0;
  return (static_cast<double>(frames.size()) - 1.0) / (frames.poses.back().time_s - frames.poses.front().time_s);
}

/// Shifts times so that the video starts at 0.
geometry::Trajectory to_video_clock(geometry::Trajectory frames) {
  const double start_s = frames.poses.front().time_s;
  for (geometry::StampedPose& pose : frames.poses) pose.time_s -= start_s;
  return frames;
}

/// Adds the video's decoded frames to the dataset.
void add_video_frames(const fs::path& video, const geometry::Trajectory& frames,
                      const std::vector<double>& exposures_ms, dataset::DatasetWriter& writer) {
  dataset::EncodeQueue queue(writer);
  dataset::read_video(video, {}, [&](std::int64_t index, double, const imaging::RgbImage& image) {
    const auto i = static_cast<std::size_t>(index);
    queue.add(i, frames.poses[i].time_s, exposures_ms[i], image);
    return true;
  });
  queue.finish();
}

}  // namespace

struct DatasetRenderer::Impl {
  Impl(const PlannedFlight& mission, const RenderSettings& settings, const fs::path& out, bool replace,
       FrameAssignment& share, const Progress& progress)
      : mission_(mission),
        settings_(settings),
        share_(share),
        part_renderer_(mission_, settings, progress),
        writer_(out, mission.calibration,
                {.replace = replace,
                 .command = "render",
                 .inputs = render_input_files(settings),
                 .png = settings.png,
                 .build_folder = share.build_folder()}),
        outputs_(writer_.temporary_folder(), settings.flight.outputs, share.segmentation_runs_folder()),
        reorder_buffer_([this](const imaging::RgbImage& image) { video_->add(image); }) {
    if (settings.flight.video && share.is_first_rank()) {
      const imaging::Camera& camera = mission.calibration.camera;
      video_.emplace(video_file(), camera.width(), camera.height(),
                     dataset::VideoOptions{.frames_per_second = frame_rate(mission.frames),
                                           .compression = *settings.flight.video});
    }
  }

  /// Renders this process's frames.
  void render(workflow::Ranks& ranks) {
    run_collectively(ranks, [&] { part_renderer_.select(share_); });
    std::string light;
    run_collectively(ranks, [&] { light = part_renderer_.meter(share_); });
    part_renderer_.set_light(ranks.all_gather(light));
    const auto start = std::chrono::steady_clock::now();
    double loading_s = 0.0;
    run_collectively(ranks, [&] {
      summary_ = part_renderer_.run(writer_.temporary_folder(), share_,
                                    [&](const render::FlightFrame& frame) { take(frame); });
      loading_s = base::seconds_since(start) - summary_.seconds;
    });
    summary_.seconds = base::seconds_since(start) - loading_s;  // includes the time spent waiting for other ranks
    SensorRecorder& recorder = *mission_.sensor_recorder;
    recorder.set_recorded(ranks.all_gather(recorder.recorded()));
  }

  void take(const render::FlightFrame& frame) {
    outputs_.add(frame);
    if (!settings_.flight.video) {
      writer_.add_frame(frame.index, frame.time_s, frame.exposure_ms, frame.rgb);
      return;
    }
    if (share_.store() != nullptr) share_.store()->add_picture(frame.index, frame.rgb);
    if (share_.renders_all_frames()) reorder_buffer_.add(frame.index, frame.rgb);
  }

  /// Completes the dataset after every process has rendered its frames; called by the first rank.
  std::vector<FrameRecord> finish() {
    part_renderer_.complete(share_, summary_);
    const std::vector<FrameRecord> frames = share_.collect_frames();
    if (settings_.flight.video) apply_video_codec(frames);
    for (std::size_t i = 0; i < frames.size(); ++i) {
      writer_.add_existing_frame(i, mission_.frames.poses[i].time_s, frames[i].exposure_ms);
    }
    outputs_.finish();
    write_metadata(writer_, mission_, settings_, summary_, frames);
    writer_.finish();
    return frames;
  }

  fs::path video_file() const { return writer_.temporary_folder() / "video.mp4"; }
  void apply_video_codec(const std::vector<FrameRecord>& frames) {
    for (std::size_t i = 0; !share_.renders_all_frames() && i < frames.size(); ++i)
      video_->add(share_.store()->read_picture(i));
    video_->finish();
    mission_.frames = to_video_clock(mission_.frames);
    std::vector<double> exposures_ms;
    for (const FrameRecord& frame : frames) exposures_ms.push_back(frame.exposure_ms);
    add_video_frames(video_file(), mission_.frames, exposures_ms, writer_);
  }

  PlannedFlight mission_;
  const RenderSettings& settings_;
  FrameAssignment& share_;
  PartRenderer part_renderer_;
  dataset::DatasetWriter writer_;
  FrameOutputWriter outputs_;
  std::optional<dataset::VideoWriter> video_;  ///< only on the first rank
  FrameReorderBuffer reorder_buffer_;
  RenderSummary summary_;
};

DatasetRenderer::DatasetRenderer(const PlannedFlight& mission, const RenderSettings& settings, const fs::path& out,
                                 bool replace, FrameAssignment& share, const Progress& progress)
    : impl_(std::make_unique<Impl>(mission, settings, out, replace, share, progress)) {}

DatasetRenderer::~DatasetRenderer() = default;

void DatasetRenderer::render(workflow::Ranks& ranks) { impl_->render(ranks); }

std::vector<FrameRecord> DatasetRenderer::finish() { return impl_->finish(); }

const RenderSummary& DatasetRenderer::summary() const { return impl_->summary_; }

}  // namespace tileflight::survey
