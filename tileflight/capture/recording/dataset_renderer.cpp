#include "tileflight/capture/recording/dataset_renderer.h"

#include <cstddef>
#include <filesystem>
#include <functional>
#include <map>
#include <mutex>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "tileflight/capture/events/event_camera.h"
#include "tileflight/capture/recording/actor_labels.h"
#include "tileflight/capture/recording/flight_faults.h"
#include "tileflight/capture/recording/flight_renderer.h"
#include "tileflight/capture/recording/frame_store.h"
#include "tileflight/capture/recording/planned_flight.h"
#include "tileflight/capture/recording/render_outputs.h"
#include "tileflight/capture/recording/render_stage.h"
#include "tileflight/capture/sensors/gnss.h"
#include "tileflight/core/base/files.h"
#include "tileflight/core/base/formatted_text.h"
#include "tileflight/core/base/program.h"
#include "tileflight/core/base/progress.h"
#include "tileflight/core/imaging/calibration_files.h"
#include "tileflight/core/imaging/photometric.h"
#include "tileflight/data/dataset/dataset.h"
#include "tileflight/data/dataset/encode_queue.h"
#include "tileflight/data/dataset/sensor_files.h"
#include "tileflight/data/video/video.h"
#include "tileflight/tiles/fetch/open_source.h"
#include "tileflight/world/place/extract.h"

namespace tileflight::recording {

namespace fs = std::filesystem;
namespace {

/// Returns the folder of a camera's files in its flight's dataset. The first camera's is that of a single camera.
fs::path camera_folder(const PlannedFlight& mission, std::size_t camera) {
  return camera == 0 ? fs::path(".") : fs::path("cameras") / mission.camera(camera).name;
}

/// Simulates receiver positions along the path, if the place is georeferenced.
std::vector<dataset::GpsFix> simulate_gps(const PlannedFlight& mission,
                                          const std::optional<geometry::LocalFrame>& frame, std::uint64_t seed) {
  if (!frame || mission.body.size() < 2) return {};
  std::vector<dataset::GpsFix> fixes;
  const sensors::GnssOptions options =
      mission.sensor_recorder->suite().gnss.value_or(sensors::GnssOptions{.seed = seed});
  for (const sensors::GnssFix& fix : sensors::simulate_gnss(mission.body, options)) {
    fixes.push_back(
        {fix.time_s, frame->geodetic_from_local(fix.position), fix.horizontal_sigma_m, fix.vertical_sigma_m});
  }
  return fixes;
}

/// Simulates gimbal measurements of the first camera's attitude, if the place is georeferenced.
std::vector<dataset::CameraAttitude> simulate_camera_attitude(const PlannedFlight& mission,
                                                              const std::optional<geometry::LocalFrame>& frame,
                                                              std::uint64_t seed) {
  if (!frame || mission.frames.size() < 2) return {};
  const sensors::AttitudeOptions options =
      mission.sensor_recorder->suite().attitude.value_or(sensors::AttitudeOptions{.seed = seed});
  const auto times = flight_path::make_sample_times("attitude", mission.frames.poses.front().time_s,
                                                    mission.frames.poses.back().time_s, options.rate_hz);
  const auto pose_at = [&](double time_s) { return *geometry::interpolate(mission.frames, time_s); };
  std::vector<dataset::CameraAttitude> attitudes;
  for (const sensors::AttitudeSample& sample : sensors::simulate_attitude(pose_at, times, options))
    attitudes.push_back(
        {sample.time_s, sample.R_local_camera, sensors::tilt_sigma_deg(options), sensors::yaw_sigma_deg(options)});
  return attitudes;
}

std::map<std::string, std::string> description(const RenderSettings& settings, const tileset::LoadedTiles& tiles) {
  return {{"made_by", "tileflight render " + base::version()},
          {"source", fetch::redact_source(settings.source)},
          {"flight", settings.flight.flight.string()},
          {"seed", std::to_string(settings.seed)},
          {"cut_sha256", tiles.cut_hash},
          {"tiles", std::to_string(tiles.cut_size - tiles.tiles_failed)},
          {"attribution", base::joined(tiles.attribution, "; ")},
          {"terms_provider", tiles.terms.provider},
          {"terms_accepted", settings.load.source.terms_accepted ? "true" : "false"}};
}

/// Writes the inverse of the camera's response, and its vignetting.
void write_photometric(const PlannedCamera& planned, const fs::path& folder) {
  const imaging::Camera& camera = planned.calibration.camera;
  const imaging::PhotometricCalibration calibration =
      render::photometric_calibration(planned.options.formation, camera.width(), camera.height());
  imaging::write_pcalib(folder / "pcalib.txt", calibration.inverse_response);
  if (!calibration.vignette.empty()) imaging::write_vignette(folder / "vignette.png", calibration.vignette);
}

/// The names of a rig's cameras; none if the flight has a `camera`.
std::vector<std::string> camera_names(const PlannedFlight& mission) {
  std::vector<std::string> names;
  for (std::size_t c = 0; c < mission.camera_count() && !mission.name.empty(); ++c)
    names.push_back(mission.camera(c).name);
  return names;
}

void write_rig(const PlannedFlight& mission, const fs::path& folder) {
  std::vector<imaging::ChainCamera> chain;
  for (std::size_t c = 0; c < mission.camera_count(); ++c) {
    const PlannedCamera& camera = mission.camera(c);
    chain.push_back(
        {camera.name, camera_folder(mission, c), camera.calibration, camera.T_body_camera, camera.timeshift_s});
  }
  imaging::write_camchain(folder / "camchain.yaml", chain);
}

/// Writes the description, true poses and calibration of one camera's images.
void write_camera_metadata(dataset::DatasetWriter& writer, const PlannedFlight& mission, std::size_t number,
                           const RenderSettings& settings, const RenderSummary& summary,
                           const std::vector<FrameRecord>& frames) {
  const PlannedCamera& camera = mission.camera(number);
  if (settings.flight.outputs.photometric) write_photometric(camera, writer.temporary_folder());
  writer.set_groundtruth(camera.frames);
  for (const auto& [key, value] : description(settings, summary.tiles)) writer.describe(key, value);
  const std::optional<geometry::LocalFrame>& frame = summary.tiles.local_frame;
  for (const auto& [key, value] : place::describe_frame(frame ? std::optional(frame->origin()) : std::nullopt))
    writer.describe(key, value);
  const auto faults = render::find_flight_faults(frame_checks(frames), 0, camera.options.clearance_m);
  for (const auto& [key, value] : faults_to_metadata(faults)) writer.describe(key, value);
  for (const auto& [key, value] : faults_to_metadata(find_actor_faults(mission, number))) writer.describe(key, value);
  render::ImageFormation formation = camera.options.formation;
  render::light_by_relief(summary.lacks_textures, formation);
  if (formation.light) {
    const auto daylight = make_daylight(*formation.light, frame ? std::optional(frame->origin()) : std::nullopt);
    writer.describe("light", describe_sun_position(daylight->sun()) +
                                 (daylight->casts_shadows() ? "" : ", without shadows: the place has no textures"));
  }
  if (const auto& weather = camera.options.render.weather) writer.describe("weather", describe_weather(*weather));
  const std::vector<std::string> names = camera_names(mission);
  if (names.empty()) return;
  writer.describe("camera", camera.name);
  writer.describe("cameras", base::joined(names));
}

/// Writes the data of the flight besides its images: other sensors, vehicle and rig.
void write_flight_metadata(dataset::DatasetWriter& writer, const PlannedFlight& mission, const RenderSettings& settings,
                           const RenderSummary& summary) {
  const std::vector<dataset::GpsFix> gps = simulate_gps(mission, summary.tiles.local_frame, settings.seed);
  if (!gps.empty()) writer.set_gps(gps);
  const auto attitudes = simulate_camera_attitude(mission, summary.tiles.local_frame, settings.seed);
  if (!attitudes.empty()) dataset::write_attitude_csv(writer.temporary_folder() / "attitude.csv", attitudes);
  mission.sensor_recorder->write(summary.tiles.local_frame, mission.body.poses.front().time_s,
                                 writer.temporary_folder());
  for (const auto& [key, value] : mission.sensor_recorder->description()) writer.describe(key, value);
  if (!mission.name.empty()) write_rig(mission, writer.temporary_folder());
  if (!mission.vehicle.is_null()) {
    base::write_file(writer.temporary_folder() / "vehicle.json", mission.vehicle.dump(2) + "\n");
  }
}

constexpr const char* kEventsFile = "events.h5";

/// Passes on frames in sequence, as a video needs them; they arrive from several threads in any order.
class FrameReorderBuffer {
 public:
  explicit FrameReorderBuffer(std::function<void(const imaging::RgbImage&)> take) : sink_(std::move(take)) {}

  void add(std::size_t index, const imaging::RgbImage& image) {
    const std::lock_guard lock(mutex_);
    if (index == next_) {
      sink_(image);
      ++next_;
    } else {
      waiting_.emplace(index, image);
    }
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

double frame_rate(const geometry::Trajectory& frames) {
  if (frames.size() < 2) return 30.0;
  return (static_cast<double>(frames.size()) - 1.0) / (frames.poses.back().time_s - frames.poses.front().time_s);
}

/// Shifts all times so that the flight starts at 0, as its videos do.
void to_video_clock(PlannedFlight& mission) {
  const double start_s = mission.body.poses.front().time_s;
  for (geometry::StampedPose& pose : mission.body.poses) pose.time_s -= start_s;
  for (std::size_t c = 0; c < mission.camera_count(); ++c) {
    for (geometry::StampedPose& pose : mission.camera(c).frames.poses) pose.time_s -= start_s;
  }
}

/// Adds the video's decoded frames to the dataset.
void add_video_frames(const fs::path& video, const geometry::Trajectory& frames,
                      const std::vector<double>& exposures_ms, dataset::DatasetWriter& writer) {
  dataset::EncodeQueue queue(writer);
  video::read_video(video, {}, [&](std::int64_t index, double, const imaging::RgbImage& image) {
    const auto i = static_cast<std::size_t>(index);
    queue.add(i, frames.poses[i].time_s, exposures_ms[i], image);
    return true;
  });
  queue.finish();
}

/// Returns FrameAssignment::segmentation_runs_folder() for one camera.
fs::path runs_folder(const FrameAssignment& share, const PlannedFlight& mission, std::size_t camera) {
  const fs::path runs = share.segmentation_runs_folder();
  if (camera == 0 || runs.empty()) return runs;
  return runs.parent_path() / (runs.filename().string() + "-" + mission.camera(camera).name);
}

/// The files of one camera. It refers to itself and cannot be moved.
struct CameraFiles {
  CameraFiles(const PlannedFlight& mission, std::size_t camera, const RenderSettings& settings,
              const FrameAssignment& share, const fs::path& out, const dataset::DatasetWriter::Options& options)
      : writer(out, mission.camera(camera).calibration, options),
        outputs(writer.temporary_folder(), settings.flight.outputs, runs_folder(share, mission, camera)),
        labels(writer.temporary_folder(), mission.traffic),
        reorder_buffer([this](const imaging::RgbImage& image) { video->add(image); }) {
    if (!settings.flight.video || !share.has_all_frames()) return;
    const imaging::Camera& lens = mission.camera(camera).calibration.camera;
    video.emplace(video_file(), lens.width(), lens.height(),
                  video::VideoOptions{.frames_per_second = frame_rate(mission.camera(camera).frames),
                                      .compression = *settings.flight.video});
  }
  CameraFiles(const CameraFiles&) = delete;
  CameraFiles& operator=(const CameraFiles&) = delete;

  fs::path video_file() const { return writer.temporary_folder() / "video.mp4"; }

  dataset::DatasetWriter writer;
  FrameOutputWriter outputs;
  ActorLabels labels;
  std::optional<video::VideoWriter> video;  ///< set if this process completes the dataset
  FrameReorderBuffer reorder_buffer;
};

}  // namespace

struct DatasetRenderer::Impl {
  Impl(const PlannedFlight& mission, const RenderSettings& settings, const fs::path& out, bool replace,
       FrameAssignment& share, const Progress& progress)
      : mission_(mission), settings_(settings), share_(share), images_(mission_) {
    cameras_.push_back(
        std::make_unique<CameraFiles>(mission_, 0, settings, share, out,
                                      dataset::DatasetWriter::Options{.replace = replace,
                                                                      .command = "render",
                                                                      .inputs = render_input_files(settings),
                                                                      .png = settings.png,
                                                                      .build_folder = share.build_folder()}));
    for (std::size_t c = 1; c < mission_.camera_count(); ++c) {
      const fs::path folder = camera_folder(mission_, c);
      cameras_.push_back(std::make_unique<CameraFiles>(
          mission_, c, settings, share, out / folder,
          dataset::DatasetWriter::Options{.png = settings.png,
                                          .build_folder = cameras_.front()->writer.temporary_folder() / folder,
                                          .is_part = true}));
    }
    renderer_.emplace(mission_, settings, share, progress);
  }

  void render() {
    summary_ = renderer_->run(cameras_.front()->writer.temporary_folder(),
                              [&](std::size_t camera, const render::FlightFrame& frame) { take(camera, frame); });
    if (mission_.has_events() && share_.has_all_frames()) record_events();
  }

  /// Records event cameras from the flight's first frame to its last: what a pixel sends depends on all that it has
  /// seen.
  void record_events() {
    std::vector<std::unique_ptr<events::EventRecorder>> recorders(cameras_.size());
    for (std::size_t c = 0; c < cameras_.size(); ++c) {
      if (mission_.camera(c).events) recorders[c] = make_recorder(c);
    }
    renderer_->record_events(recorders);
    const double start_s = settings_.flight.video ? mission_.body.poses.front().time_s : 0.0;
    for (std::size_t c = 0; c < cameras_.size(); ++c) {
      if (!recorders[c]) continue;
      // The file's clock is the dataset's, which starts at 0 beside a video.
      recorders[c]->finish(mission_.camera(c).frames.poses.front().time_s - start_s);
      event_counts_[c] = recorders[c]->counts();
    }
  }

  std::unique_ptr<events::EventRecorder> make_recorder(std::size_t number) const {
    const PlannedCamera& camera = mission_.camera(number);
    return std::make_unique<events::EventRecorder>(camera.calibration.camera, camera.pose_at, *camera.events,
                                                   camera.frames,
                                                   cameras_[number]->writer.temporary_folder() / kEventsFile);
  }

  void describe_events(std::size_t number) {
    const auto found = event_counts_.find(number);
    if (found == event_counts_.end()) return;
    const events::EventCounts& counts = found->second;
    dataset::DatasetWriter& writer = cameras_[number]->writer;
    writer.describe("events.file", kEventsFile);
    writer.describe("events.count", std::to_string(counts.events));
    writer.describe("events.brighter", std::to_string(counts.positive));
    writer.describe("events.light_samples", std::to_string(counts.samples));
    writer.describe("events.camera", events::describe_event_options(*mission_.camera(number).events));
    summary_.events += counts.events;
  }

  void take(std::size_t camera, const render::FlightFrame& frame) {
    CameraFiles& files = *cameras_[camera];
    files.outputs.add(frame);
    files.labels.add(frame, mission_.camera(camera).frames.poses[frame.index].T_local_camera);
    if (!settings_.flight.video) {
      files.writer.add_frame(frame.index, frame.time_s, frame.exposure_ms, frame.rgb);
      return;
    }
    if (share_.store() != nullptr) share_.store()->add_picture(images_.number_of(camera, frame.index), frame.rgb);
    if (share_.renders_all_frames()) files.reorder_buffer.add(frame.index, frame.rgb);
  }

  /// Completes the dataset once all images are rendered.
  std::vector<FrameRecord> finish() {
    renderer_->complete(summary_);
    const std::vector<FrameRecord> images = share_.collect_frames();
    if (settings_.flight.video) to_video_clock(mission_);
    for (std::size_t c = cameras_.size(); c-- > 0;) finish_camera(c, frames_of(c, images));
    return images;
  }

  std::vector<FrameRecord> frames_of(std::size_t camera, const std::vector<FrameRecord>& images) const {
    std::vector<FrameRecord> frames;
    for (std::size_t i = 0; i < mission_.camera(camera).frames.size(); ++i)
      frames.push_back(images[images_.number_of(camera, i)]);
    return frames;
  }

  /// Completes a camera's folder. The first camera is the last, since its folder is the dataset.
  void finish_camera(std::size_t number, const std::vector<FrameRecord>& frames) {
    const PlannedCamera& camera = mission_.camera(number);
    CameraFiles& files = *cameras_[number];
    if (settings_.flight.video) apply_video_codec(number, frames);
    for (std::size_t i = 0; i < frames.size(); ++i) {
      files.writer.add_existing_frame(i, camera.frames.poses[i].time_s, frames[i].exposure_ms);
    }
    files.outputs.finish();
    const imaging::Camera& lens = camera.calibration.camera;
    files.labels.finish(frames.size(), lens.width(), lens.height(), settings_.png ? ".png" : ".jpg");
    describe_events(number);
    write_camera_metadata(files.writer, mission_, number, settings_, summary_, frames);
    if (number == 0) write_flight_metadata(files.writer, mission_, settings_, summary_);
    files.writer.finish();
  }

  void apply_video_codec(std::size_t number, const std::vector<FrameRecord>& frames) {
    CameraFiles& files = *cameras_[number];
    for (std::size_t i = 0; !share_.renders_all_frames() && i < frames.size(); ++i)
      files.video->add(share_.store()->read_picture(images_.number_of(number, i)));
    files.video->finish();
    std::vector<double> exposures_ms;
    for (const FrameRecord& frame : frames) exposures_ms.push_back(frame.exposure_ms);
    add_video_frames(files.video_file(), mission_.camera(number).frames, exposures_ms, files.writer);
  }

  PlannedFlight mission_;
  const RenderSettings& settings_;
  FrameAssignment& share_;
  ImageOrder images_;
  std::vector<std::unique_ptr<CameraFiles>> cameras_;
  std::optional<FlightRenderer> renderer_;
  std::map<std::size_t, events::EventCounts> event_counts_;  ///< of the event cameras, by their numbers
  RenderSummary summary_;
};

DatasetRenderer::DatasetRenderer(const PlannedFlight& mission, const RenderSettings& settings, const fs::path& out,
                                 bool replace, FrameAssignment& share, const Progress& progress)
    : impl_(std::make_unique<Impl>(mission, settings, out, replace, share, progress)) {}

DatasetRenderer::~DatasetRenderer() = default;

void DatasetRenderer::render() { impl_->render(); }

std::vector<FrameRecord> DatasetRenderer::finish() { return impl_->finish(); }

const RenderSummary& DatasetRenderer::summary() const { return impl_->summary_; }

}  // namespace tileflight::recording
