#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <vector>

#include "tileflight/capture/events/dsec_file.h"
#include "tileflight/capture/events/event_options.h"
#include "tileflight/capture/events/event_pixels.h"
#include "tileflight/capture/events/image_motion.h"
#include "tileflight/capture/render/appearance.h"
#include "tileflight/capture/render/camera_renderer.h"
#include "tileflight/capture/render/render_flight.h"
#include "tileflight/core/geometry/trajectory.h"
#include "tileflight/world/scene/scene.h"

namespace tileflight::events {

/// Consumes the events of an interval; intervals follow each other.
using EventSink = std::function<void(const std::vector<Event>& events)>;

/// The view of an event camera during an interval.
struct EventScene {
  const scene::Scene& scene;
  render::RenderOptions render;                            ///< light, haze and weather; depth is not needed
  render::PlacedParts placed{};                            ///< what moves; empty: nothing
  std::shared_ptr<const render::Appearance> appearance{};  ///< of the scene, if it is shared; null: made here
};

/// A span of time, seconds on the clock of the camera's poses.
struct TimeSpan {
  double begin_s = 0.0, end_s = 0.0;
};

/// Counts of a recording.
struct EventCounts {
  std::uint64_t events = 0, positive = 0, samples = 0;
};

/// An event camera that moves through a scene. It takes samples of the scene's linear light (luminance, Rec. 709) so
/// densely that nothing that it sees moves by more than max_motion_px between two (ESIM's adaptive sampling), and
/// passes them to its pixels. The times of samples depend on the spans that it records alone, so that a recording is
/// the same however tiles are loaded; rows and exposure of a shutter do not exist for it.
class EventCamera {
 public:
  /// `start_s`: the recording's first instant, of which event times are counted: from the microsecond in which it lies.
  /// Throws InputError for options out of range.
  EventCamera(imaging::Camera camera, render::PoseFunction pose_at, const EventOptions& options, double start_s);

  /// Records consecutive spans, each sampled at its beginning and its end. If the place looks different at the
  /// beginning of the first span (other tiles of the same place), that causes no event. Throws InputError for too many
  /// events. `span_done`, if any, is called after each span with their number.
  void record(const EventScene& scene, const std::vector<TimeSpan>& spans, const EventSink& sink,
              const std::function<void(std::size_t spans)>& span_done = {});

  const EventCounts& counts() const { return counts_; }

 private:
  struct Sample;
  class SceneView;

  Sample sample_at(const SceneView& view, double time_s) const;
  double longest_step_s(const SceneView& view, const Sample& from, double end_s) const;
  Sample next_sample(const SceneView& view, const Sample& from, double end_s) const;
  bool changes_too_much(const Sample& from, const Sample& to) const;
  void record_span(const SceneView& view, Sample& now, const TimeSpan& span, const EventSink& sink);
  void require_bearable(std::uint64_t events, const TimeSpan& span) const;

  imaging::Camera camera_;
  render::PoseFunction pose_at_;
  EventOptions options_;
  double start_s_, origin_s_;
  ImageMotion motion_;
  EventPixels pixels_;
  std::shared_ptr<const render::CameraRays> rays_;
  bool is_started_ = false;
  EventCounts counts_;
};

/// Records an event camera along a flight's frames into a file (dsec_file.h), from the first frame to the last, in
/// parts of the flight that follow each other.
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
