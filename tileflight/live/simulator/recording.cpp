#include "tileflight/live/simulator/recording.h"

#include <algorithm>

#include "tileflight/core/base/input_error.h"
#include "tileflight/live/simulator/frames.h"
#include "tileflight/live/simulator/world.h"

namespace tileflight::simulator {

/// Takes images and poses at one time. Runs without the mutex in the clock's thread, so time does not advance.
std::vector<RecordingFrame> World::capture_recording_frames() {
  std::vector<std::string> names;
  {
    const std::lock_guard lock(state_mutex);
    for (const auto& one : vehicles) names.push_back(one->vehicle->name());
  }
  std::vector<RecordingFrame> moments;
  for (const std::string& name : names) {
    std::vector<ImageRequest> requests;
    std::vector<RecordingCamera> cameras;
    for (const RecordingCamera& camera : settings.recording.cameras) {
      if (!camera.vehicle.empty() && camera.vehicle != name) continue;
      requests.push_back(
          {camera.camera, camera.image_type, camera.pixels_as_float, camera.compress, camera.annotation});
      cameras.push_back(camera);
    }
    if (requests.empty()) continue;
    PlannedImages planned;
    RecordingFrame moment{name, 0, {}, {}};
    {
      const std::lock_guard lock(state_mutex);
      planned = plan_images(requests, name, false);
      remember_camera_poses(planned);
      const SimVehicle& sim_vehicle = *slot(name).vehicle;
      geometry::SE3 T = sim_vehicle.state().T_ned_body;
      T.translation -= sim_vehicle.start_ned();
      moment.pose = to_airsim(T);
      moment.time_ns = planned.time_ns;
    }
    std::vector<ImageResponse> responses = render_images(planned);
    for (std::size_t i = 0; i < responses.size(); ++i) {
      const CameraView& shot = planned.images[i].view;
      moment.images.push_back({cameras[i], std::move(responses[i]), shot.lens, shot.T_local_camera});
    }
    moments.push_back(std::move(moment));
  }
  return moments;
}

void World::record_if_due(double time_s) {
  {
    const std::lock_guard lock(state_mutex);
    if (!recorder || time_s + 1e-9 < next_record_s) return;
    next_record_s += settings.recording.interval_s;
  }
  try {
    const std::vector<RecordingFrame> moments = capture_recording_frames();
    const std::lock_guard lock(recording_mutex);
    for (const RecordingFrame& moment : moments) {
      if (recorder) recorder->add(moment);
    }
  } catch (const std::exception& error) {
    log_line("recording stopped: " + std::string(error.what()));
    const std::scoped_lock lock(recording_mutex, state_mutex);
    recorder.reset();
  }
}

/// The first line is recorded at the next step. Throws InputError.
void World::begin_recording() {
  const std::string& named = settings.recording.folder;
  const auto& root = file_access.root();
  if (named.empty() && !root) {
    throw InputError(
        "startRecording",
        "there is nowhere to record to: set Recording.Folder in the settings, or start the server with --files FOLDER");
  }
  const std::scoped_lock lock(recording_mutex, state_mutex);
  if (recorder) return;
  const std::filesystem::path parent = named.empty() ? *root / "recordings" : std::filesystem::path(named);
  recorder = std::make_unique<Recorder>(parent, settings.recording);
  next_record_s = clock.time_s() + SimulationClock::kStep_s;
  log_line("recording to " + recorder->folder().string());
}

void Recording::start() { world_.begin_recording(); }

void Recording::stop() {
  std::unique_ptr<Recorder> finished;
  {
    const std::scoped_lock lock(world_.recording_mutex, world_.state_mutex);
    finished = std::move(world_.recorder);
  }
  if (finished) finished->finish();
}

bool Recording::is_recording() const {
  const std::lock_guard lock(world_.state_mutex);
  return world_.recorder != nullptr;
}

}  // namespace tileflight::simulator
