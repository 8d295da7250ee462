#include "tileflight/capture/events/event_recorder.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "tileflight/core/base/input_error.h"

namespace tileflight::events {
namespace {

std::vector<double> times_of(const geometry::Trajectory& frames) {
  std::vector<double> times_s;
  for (const geometry::StampedPose& pose : frames.poses) times_s.push_back(pose.time_s);
  return times_s;
}

/// The camera, unless its events do not fit into the types of DSEC's layout.
const imaging::Camera& fitting(const imaging::Camera& camera, const geometry::Trajectory& frames) {
  constexpr int kMostPixels = 1 << 16;
  if (frames.empty() || camera.width() > kMostPixels || camera.height() > kMostPixels)
    throw InputError("events", "need a frame, and at most 65536 pixels a side");
  const double duration_us = 1e6 * (frames.poses.back().time_s - frames.poses.front().time_s);
  if (duration_us >= static_cast<double>(std::numeric_limits<std::uint32_t>::max()) - 1000.0)
    throw InputError("events",
                     "the flight is longer than the 71 minutes that DSEC's time stamps hold; fly it in parts");
  return camera;
}

}  // namespace

EventRecorder::EventRecorder(const imaging::Camera& camera, render::PoseFunction pose_at, const EventOptions& options,
                             const geometry::Trajectory& frames, const std::filesystem::path& file)
    : camera_(fitting(camera, frames), std::move(pose_at), options, frames.poses.front().time_s),
      times_s_(times_of(frames)),
      writer_(file) {}

void EventRecorder::record(const EventScene& scene, std::size_t begin, std::size_t end,
                           const std::function<void(std::size_t frames)>& frame_done) {
  std::vector<TimeSpan> spans;
  for (std::size_t frame = begin; frame < end && frame + 1 < times_s_.size(); ++frame)
    spans.push_back({times_s_[frame], times_s_[frame + 1]});
  camera_.record(
      scene, spans, [this](const std::vector<Event>& events) { writer_.add(events); }, frame_done);
}

void EventRecorder::finish(double first_frame_s) {
  const double start_us = std::floor(times_s_.front() * 1e6);
  const auto end_us = static_cast<std::uint32_t>(std::max(0.0, std::ceil(times_s_.back() * 1e6 - start_us)));
  writer_.finish(static_cast<std::int64_t>(std::floor(first_frame_s * 1e6)), end_us);
}

}  // namespace tileflight::events
