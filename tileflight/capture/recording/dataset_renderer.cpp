#include "tileflight/capture/recording/dataset_renderer.h"

#include <functional>
#include <map>
#include <mutex>

#include "tileflight/capture/events/event_camera.h"
#include "tileflight/capture/recording/actor_labels.h"
#include "tileflight/capture/recording/dataset_metadata.h"
#include "tileflight/capture/recording/render_outputs.h"
#include "tileflight/data/dataset/encode_queue.h"
#include "tileflight/data/dataset/video.h"

namespace tileflight::recording {
namespace fs = std::filesystem;
namespace {

constexpr const char* kEventsFile = "events.h5";

/// Frames arrive from several threads in any order; a video needs them in sequence.
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
  dataset::read_video(video, {}, [&](std::int64_t index, double, const imaging::RgbImage& image) {
    const auto i = static_cast<std::size_t>(index);
    queue.add(i, frames.poses[i].time_s, exposures_ms[i], image);
    return true;
  });
  queue.finish();
}

/// FrameAssignment::segmentation_runs_folder of one camera.
fs::path runs_folder(const FrameAssignment& share, const PlannedFlight& mission, std::size_t camera) {
  const fs::path runs = share.segmentation_runs_folder();
  if (camera == 0 || runs.empty()) return runs;
  return runs.parent_path() / (runs.filename().string() + "-" + mission.camera(camera).name);
}

/// What is written of one camera. Not to be moved: it refers to itself.
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
                  dataset::VideoOptions{.frames_per_second = frame_rate(mission.camera(camera).frames),
                                        .compression = *settings.flight.video});
  }
  CameraFiles(const CameraFiles&) = delete;
  CameraFiles& operator=(const CameraFiles&) = delete;

  fs::path video_file() const { return writer.temporary_folder() / "video.mp4"; }

  dataset::DatasetWriter writer;
  FrameOutputWriter outputs;
  ActorLabels labels;
  std::optional<dataset::VideoWriter> video;  ///< set if this process completes the dataset
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

  /// The first camera is the last: its folder is the dataset.
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
