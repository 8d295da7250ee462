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
#include "tileflight/survey/actor_labels.h"
#include "tileflight/survey/flight_faults.h"
#include "tileflight/survey/frame_output_writer.h"
#include "tileflight/survey/part_renderer.h"
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
  for (const auto& [key, value] : faults_to_metadata(find_actor_faults(mission))) writer.describe(key, value);
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
        labels_(writer_.temporary_folder(), mission.traffic),
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
    labels_.add(frame, mission_.frames.poses[frame.index].T_local_camera);
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
    const imaging::Camera& camera = mission_.calibration.camera;
    labels_.finish(frames.size(), camera.width(), camera.height(), settings_.png ? ".png" : ".jpg");
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
  ActorLabels labels_;
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
