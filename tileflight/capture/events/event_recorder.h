#pragma once

#include <cstddef>
#include <filesystem>
#include <functional>
#include <vector>

#include "tileflight/capture/events/dsec_file.h"
#include "tileflight/capture/events/event_camera.h"
#include "tileflight/core/geometry/trajectory.h"

namespace tileflight::events {

/// Records an event camera along a flight's frames into a file (dsec_file.h): from the first frame to the last, part of
/// the flight by part.
class EventRecorder {
 public:
  /// `frames`: times of the camera's frames, on the clock of `pose_at`. Throws InputError for a flight longer than the
  /// 71 minutes that DSEC's time stamps hold, for a picture larger than 65536 pixels a side, and for a file that cannot
  /// be written.
  EventRecorder(const imaging::Camera& camera, render::PoseFunction pose_at, const EventOptions& options,
                const geometry::Trajectory& frames, const std::filesystem::path& file);

  /// Records from frame `begin` to frame `end`, or to the last one; the next call begins there. `frame_done`, if any,
  /// is called after each frame with their number since `begin`.
  void record(const EventScene& scene, std::size_t begin, std::size_t end,
              const std::function<void(std::size_t frames)>& frame_done = {});
  /// Completes the file. `first_frame_s`: the first frame's time on the dataset's clock.
  void finish(double first_frame_s);

  const EventCounts& counts() const { return camera_.counts(); }

 private:
  EventCamera camera_;
  std::vector<double> times_s_;
  DsecWriter writer_;
};

}  // namespace tileflight::events
