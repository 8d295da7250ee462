#include <algorithm>

#include "tileflight/geometry/input_error.h"
#include "tileflight/simulator/frames.h"
#include "tileflight/simulator/simulator_impl.h"

namespace tileflight::simulator {

/// Pictures and pose of the same moment. Without the mutex, in the clock's thread: time stands still.
std::vector<RecordedMoment> Simulator::Impl::recorded_moments() {
  std::vector<std::string> names;
  {
    const std::lock_guard lock(state);
    for (const auto& one : fleet) names.push_back(one->craft->name());
  }
  std::vector<RecordedMoment> moments;
  for (const std::string& name : names) {
    std::vector<ImageRequest> requests;
    std::vector<RecordedCamera> cameras;
    for (const RecordedCamera& camera : settings.recording.cameras) {
      if (!camera.vehicle.empty() && camera.vehicle != name) continue;
      requests.push_back({camera.camera, camera.image_type, camera.pixels_as_float, camera.compress});
      cameras.push_back(camera);
    }
    if (requests.empty()) continue;
    PlannedPictures planned;
    RecordedMoment moment{name, 0, {}, {}};
    {
      const std::lock_guard lock(state);
      planned = plan(requests, name, false);
      note_taken(planned);
      const Craft& craft = *vehicle(name).craft;
      geometry::SE3 T = craft.state().T_ned_body;
      T.translation -= craft.start_ned();
      moment.pose = wire(T);
      moment.time_ns = planned.time_ns;
    }
    std::vector<ImageResponse> responses = take(planned);
    for (std::size_t i = 0; i < responses.size(); ++i) {
      const Shot& shot = planned.pictures[i].shot;
      moment.pictures.push_back({cameras[i], std::move(responses[i]), shot.lens, shot.T_local_camera});
    }
    moments.push_back(std::move(moment));
  }
  return moments;
}

void Simulator::Impl::record_if_due(double time_s) {
  {
    const std::lock_guard lock(state);
    if (!recorder || time_s + 1e-9 < next_record_s) return;
    next_record_s += settings.recording.interval_s;
  }
  try {
    const std::vector<RecordedMoment> moments = recorded_moments();
    const std::lock_guard lock(recording);
    for (const RecordedMoment& moment : moments) {
      if (recorder) recorder->add(moment);
    }
  } catch (const std::exception& error) {
    say("recording stopped: " + std::string(error.what()));
    const std::scoped_lock lock(recording, state);
    recorder.reset();
  }
}

/// The first line is of the next step. Throws InputError.
void Simulator::Impl::begin_recording() {
  const std::string& named = settings.recording.folder;
  const auto& root = files.root();
  if (named.empty() && !root) {
    throw InputError("startRecording",
                     "there is nowhere to record to: give Recording.Folder in the settings, or start the server with "
                     "--files FOLDER");
  }
  const std::scoped_lock lock(recording, state);
  if (recorder) return;
  const std::filesystem::path parent = named.empty() ? *root / "recordings" : std::filesystem::path(named);
  recorder = std::make_unique<Recorder>(parent, settings.recording);
  next_record_s = engine.time_s() + Engine::kStep_s;
  say("recording to " + recorder->folder().string());
}

void Simulator::start_recording() { impl_->begin_recording(); }

void Simulator::stop_recording() {
  std::unique_ptr<Recorder> finished;
  {
    const std::scoped_lock lock(impl_->recording, impl_->state);
    finished = std::move(impl_->recorder);
  }
  if (finished) finished->finish();
}

bool Simulator::is_recording() const {
  const std::lock_guard lock(impl_->state);
  return impl_->recorder != nullptr;
}

}  // namespace tileflight::simulator
