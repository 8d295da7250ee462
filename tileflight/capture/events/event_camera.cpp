#include "tileflight/capture/events/event_camera.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <utility>

#include "tileflight/capture/events/image_motion.h"
#include "tileflight/capture/render/frame_renderer.h"
#include "tileflight/capture/render/ray_table.h"
#include "tileflight/core/base/formatted_text.h"
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

namespace {

constexpr double kShortestStep_s = 1e-6;  // resolution of the events' times
constexpr double kAimedShare = 0.9;       // of the largest motion, so that the next sample seldom has to be taken again

/// Returns the fraction of the current microsecond that has passed at a time.
double fraction_of_microsecond_s(double time_s) { return 1e-6 * (time_s * 1e6 - std::floor(time_s * 1e6)); }

/// Natural logarithm of luminance (Rec. 709) and dark light.
imaging::FloatImage log_light_of(const render::LinearImage& light, double dark_light) {
  const auto dark = static_cast<float>(dark_light);
  imaging::FloatImage logs(light.width, light.height);
  tbb::parallel_for(0, light.height, [&](int y) {
    for (int x = 0; x < light.width; ++x) {
      const render::LinearRgb& rgb = light(x, y);
      logs(x, y) = std::log(std::max(0.0F, 0.2126F * rgb[0] + 0.7152F * rgb[1] + 0.0722F * rgb[2]) + dark);
    }
  });
  return logs;
}

}  // namespace

/// The scene through the camera's lens.
class EventCamera::SceneView {
 public:
  SceneView(const EventScene& seen, const imaging::Camera& camera, std::shared_ptr<const render::CameraRays> rays)
      : seen_(seen), options_(seen.render) {
    options_.depth = false;
    with_placed_ = scene_at(0.0);
    const scene::Scene& whole = with_placed_ ? *with_placed_ : seen.scene;
    auto appearance =
        seen.appearance && !with_placed_ ? seen.appearance : std::make_shared<const render::Appearance>(whole);
    if (rays)
      renderer_.emplace(whole, std::move(appearance), std::move(rays), options_);
    else
      renderer_.emplace(whole, std::move(appearance), camera, options_);
  }
  SceneView(const SceneView&) = delete;
  SceneView& operator=(const SceneView&) = delete;

  std::shared_ptr<const render::CameraRays> rays() const { return renderer_->rays(); }
  /// With what is placed; nullopt: nothing is.
  std::optional<scene::Scene> scene_at(double time_s) const {
    return render::with_placed_parts(seen_.scene, seen_.placed, time_s, time_s);
  }
  render::LinearImage light(const geometry::SE3& T_local_camera, const std::optional<scene::Scene>& with_placed,
                            SeenSurface& surface) const {
    const render::ShutterPoses pose{1, 1, {T_local_camera}};
    if (!with_placed) return renderer_->render_light(pose, surface.visitor(seen_.scene)).light;
    const render::CameraRenderer renderer(*with_placed, renderer_->appearance(), renderer_->rays(), options_);
    return renderer.render_light(pose, surface.visitor(*with_placed)).light;
  }

 private:
  const EventScene& seen_;
  render::RenderOptions options_;
  std::optional<scene::Scene> with_placed_;  ///< at some time, for what does not depend on poses
  std::optional<render::CameraRenderer> renderer_;
};

/// The view at one instant.
struct EventCamera::Sample {
  double time_s = 0.0;
  geometry::SE3 T_local_camera;
  std::optional<scene::Scene> with_placed;
  imaging::FloatImage log_light;
  std::vector<ImageMotion::Point> points;

  SceneInstant instant() const { return {T_local_camera, with_placed ? &*with_placed : nullptr}; }
};

EventCamera::EventCamera(imaging::Camera camera, render::PoseFunction pose_at, const EventOptions& options,
                         double start_s)
    : camera_(std::move(camera)),
      pose_at_(std::move(pose_at)),
      options_(options),
      start_s_(start_s),
      origin_s_(-fraction_of_microsecond_s(start_s)),
      motion_(camera_),
      pixels_(camera_.width(), camera_.height(), options) {
  validate_event_options(options);
}

EventCamera::Sample EventCamera::sample_at(const SceneView& view, double time_s) const {
  Sample sample{time_s, pose_at_(time_s), view.scene_at(time_s), {}, {}};
  SeenSurface surface(camera_.width(), camera_.height());
  sample.log_light = log_light_of(view.light(sample.T_local_camera, sample.with_placed, surface), options_.dark_light);
  sample.points = motion_.nearest_points(surface);
  return sample;
}

/// Returns the longest step in which the images of the surfaces seen now move by at most the aimed share of
/// max_motion_px, also on the way.
double EventCamera::longest_step_s(const SceneView& view, const Sample& from, double end_s) const {
  const auto motion_px = [&](double step_s) {
    double largest = 0.0;
    for (const double share : {0.5, 1.0}) {
      const double time_s = from.time_s + share * step_s;
      const std::optional<scene::Scene> with_placed = view.scene_at(time_s);
      largest = std::max(largest, motion_.largest_px(from.points, from.instant(),
                                                     {pose_at_(time_s), with_placed ? &*with_placed : nullptr}));
    }
    return largest;
  };
  const double aimed_px = kAimedShare * options_.max_motion_px;
  double step_s = std::min(options_.max_step_s, end_s - from.time_s);
  for (double px = motion_px(step_s); px > aimed_px && step_s > kShortestStep_s; px = motion_px(step_s))
    step_s = std::max(kShortestStep_s, step_s * std::clamp(0.99 * aimed_px / px, 0.02, 0.95));
  return step_s;
}

bool EventCamera::changes_too_much(const Sample& from, const Sample& to) const {
  if (options_.max_change <= 0.0) return false;
  std::size_t many = 0;
  for (std::size_t i = 0; i < to.log_light.pixels.size(); ++i)
    many += std::abs(to.log_light.pixels[i] - from.log_light.pixels[i]) > options_.max_change ? 1U : 0U;
  return many * 1000 > to.log_light.pixels.size();
}

/// Takes the next sample. Surfaces that come into view only then may be nearer than those seen before; the sample is
/// then taken again, earlier.
EventCamera::Sample EventCamera::next_sample(const SceneView& view, const Sample& from, double end_s) const {
  const double rest_s = end_s - from.time_s;
  double step_s = longest_step_s(view, from, end_s);
  if (step_s < rest_s && 2.0 * step_s > rest_s) step_s = 0.5 * rest_s;
  while (true) {
    Sample next = sample_at(view, step_s >= rest_s ? end_s : from.time_s + step_s);
    if (step_s <= kShortestStep_s) return next;
    const double px = motion_.largest_px(next.points, next.instant(), from.instant());
    if (px <= options_.max_motion_px && !changes_too_much(from, next)) return next;
    const double share = px > options_.max_motion_px ? kAimedShare * options_.max_motion_px / px : 0.5;
    step_s = std::max(kShortestStep_s, step_s * std::max(0.02, share));
  }
}

void EventCamera::require_bearable(std::uint64_t events, const TimeSpan& span) const {
  const double pixel_seconds = static_cast<double>(camera_.width()) * camera_.height() * (span.end_s - span.begin_s);
  if (static_cast<double>(events) <= options_.max_rate_hz * pixel_seconds) return;
  throw InputError("events", base::formatted("more than %g a second and pixel (max_rate_hz) from %.6f to %.6f s; raise "
                                             "the thresholds or the refractory time, or max_rate_hz",
                                             options_.max_rate_hz, span.begin_s, span.end_s));
}

void EventCamera::record_span(const SceneView& view, Sample& now, const TimeSpan& span, const EventSink& sink) {
  std::uint64_t of_span = 0;
  while (now.time_s < span.end_s) {
    Sample next = next_sample(view, now, span.end_s);
    const std::vector<Event> events = pixels_.advance(next.log_light, next.time_s - start_s_, origin_s_);
    of_span += events.size();
    require_bearable(of_span, span);
    ++counts_.samples;
    counts_.events += events.size();
    counts_.positive += static_cast<std::uint64_t>(
        std::ranges::count_if(events, [](const Event& event) { return event.polarity != 0; }));
    if (!events.empty()) sink(events);
    now = std::move(next);
  }
}

void EventCamera::record(const EventScene& scene, const std::vector<TimeSpan>& spans, const EventSink& sink,
                         const std::function<void(std::size_t spans)>& span_done) {
  if (spans.empty()) return;
  const SceneView view(scene, camera_, rays_);
  rays_ = view.rays();
  Sample now = sample_at(view, spans.front().begin_s);
  if (is_started_) {
    pixels_.replace(now.log_light);
  } else {
    pixels_.start(now.log_light, now.time_s - start_s_);
    is_started_ = true;
  }
  std::size_t done = 0;
  for (const TimeSpan& span : spans) {
    record_span(view, now, span, sink);
    if (span_done) span_done(++done);
  }
}

}  // namespace tileflight::events
