#include "tileflight/sensors/fly.h"

#include <tbb/parallel_pipeline.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <mutex>
#include <optional>
#include <sstream>
#include <utility>

#include "tileflight/flight/path.h"
#include "tileflight/geometry/input_error.h"

namespace tileflight::sensors {
namespace {

using geometry::SE3;
using geometry::StampedPose;
using geometry::Trajectory;

bool has_shutter(const ImageFormation& formation) {
  return formation.exposure_time_s > 0.0 || formation.line_delay_s != 0.0;
}

/// The poses that a shutter is asked for: the given function, else a spline through the frames.
PoseFunction shutter_path(const PoseFunction& pose_at, const Trajectory& frames, const ImageFormation& formation) {
  if (pose_at || !has_shutter(formation)) return pose_at;
  if (frames.size() == 1) return [T = frames.poses[0].T_local_camera](double) { return T; };
  return [path = flight::path_through_poses(frames)](double time_s) { return path.pose(time_s); };
}

/// Frames that are rendered.
struct FrameRange {
  std::size_t begin = 0;
  std::size_t end = 0;

  std::size_t count() const { return end - begin; }
};

FrameRange range_of(const FlightOptions& options, std::size_t frames) {
  const std::size_t end = std::min(options.end_frame, frames);
  return {std::min(options.first_frame, end), end};
}

std::int64_t wanted_in(const FrameRange& range, const FlightOptions& options) {
  std::int64_t count = 0;
  for (std::size_t i = range.begin; i < range.end; ++i) count += options.wanted(i) ? 1 : 0;
  return count;
}

/// With the formation's light and haze.
RenderOptions in_air(const FlightOptions& options) {
  const ImageFormation& formation = options.formation;
  RenderOptions render = options.render;
  render.haze_per_m = haze_per_m(formation);
  render.haze_color = formation.haze_color;
  if (formation.light) render.daylight = daylight_at(*formation.light, options.origin);
  return render;
}

/// From one frame to the next: along the path, where it is known, in steps that no bend is lost in.
std::vector<geometry::Vec3> way_between(const StampedPose& from, const StampedPose& to, const PoseFunction& pose_at) {
  constexpr double kStep_m = 0.5, kMostSteps = 32.0;
  std::vector<geometry::Vec3> way{from.T_local_camera.translation};
  const double length_m = (to.T_local_camera.translation - way.front()).norm();
  const int steps = pose_at ? static_cast<int>(std::clamp(std::ceil(length_m / kStep_m), 1.0, kMostSteps)) : 1;
  for (int k = 1; k < steps; ++k)
    way.push_back(pose_at(from.time_s + (to.time_s - from.time_s) * k / steps).translation);
  way.push_back(to.T_local_camera.translation);
  return way;
}

/// Makes one frame after another; several threads may each make one.
class FrameMaker {
 public:
  FrameMaker(const scene::Scene& scene, const imaging::Camera& camera, const Trajectory& frames,
             const PoseFunction& pose_at, const FlightOptions& options)
      : scene_(scene),
        in_air_(in_air(options)),
        renderer_(scene, camera, in_air_),
        outputs_(renderer_, scene, options.outputs, options.place),
        has_outputs_(options.outputs.any()),
        frames_(frames),
        first_frame_(range_of(options, frames.size()).begin),
        formation_(options.formation),
        path_(pose_at),
        pose_at_(shutter_path(pose_at, frames, options.formation)),
        clearance_m_(options.clearance_m),
        vignette_(vignette_of(formation_, camera.width(), camera.height())),
        exposure_(options.exposure_before) {
    RenderOptions colour = in_air_;
    colour.depth = false;
    const auto with_lens = [&](double larger, std::optional<CameraRenderer>& renderer) {
      if (larger != 0.0) renderer.emplace(scene, renderer_.appearance(), magnified(camera, larger), colour);
    };
    with_lens(formation_.chromatic_red, red_);
    with_lens(formation_.chromatic_blue, blue_);
    if (formation_.auto_exposure.target > 0.0) meter(scene, colour, range_of(options, frames.size()));
  }

  /// After the last of the range's frames; nullopt without an automatic exposure.
  const std::optional<ExposureState>& exposure_after() const { return exposure_; }

  SensedFrame make(std::size_t index) const {
    SensedFrame frame;
    frame.index = index;
    frame.time_s = frames_.poses[index].time_s;
    frame.exposure_ms = 1e3 * formation_.exposure_time_s * gain_of(index);
    take_picture(frame);
    if (has_outputs_) {
      frame.outputs = outputs_.render(rows_of(index), rows_of(index + 1));
      frame.objects = outputs_.objects();
    }
    frame.check.around = scene::surroundings_at(scene_, frames_.poses[index].T_local_camera.translation, clearance_m_);
    frame.check.path_is_blocked = is_blocked_after(index);
    return frame;
  }

 private:
  /// The automatic exposure's gains of all frames, before the first is rendered.
  void meter(const scene::Scene& scene, const RenderOptions& options, const FrameRange& range) {
    const std::span<const StampedPose> poses = std::span(frames_.poses).subspan(range.begin, range.count());
    std::vector<double> times_s;
    for (const StampedPose& pose : poses) times_s.push_back(pose.time_s);
    const std::vector<double> light =
        metered_light(scene, renderer_.appearance(), renderer_.camera(), options, formation_, poses);
    gains_ = exposure_gains(formation_.auto_exposure, times_s, light, exposure_);
  }
  void take_picture(SensedFrame& frame) const {
    if (is_ideal(formation_)) {
      RenderedFrame rendered = renderer_.render(frames_.poses[frame.index].T_local_camera);
      frame.rgb = std::move(rendered.rgb);
      frame.depth_m = std::move(rendered.depth_m);
      frame.check.view = rendered.view;
      return;
    }
    LightFrame light = light_of(frame.index);
    frame.rgb = develop(light.light, vignette_, formation_, gain_of(frame.index), frame.index);
    frame.depth_m = std::move(light.depth_m);
    frame.check.view = light.view;
  }
  /// Red and blue through lenses of their own, where they have one.
  LightFrame light_of(std::size_t index) const {
    const ShutterPoses poses = poses_of(index, gain_of(index));
    LightFrame light = renderer_.render_light(poses);
    if (red_) take_channel(0, red_->render_light(poses).light, light.light);
    if (blue_) take_channel(2, blue_->render_light(poses).light, light.light);
    return light;
  }
  bool is_blocked_after(std::size_t index) const {
    const auto& poses = frames_.poses;
    return index + 1 < poses.size() &&
           scene::passes_through(scene_, way_between(poses[index], poses[index + 1], path_));
  }
  static void take_channel(std::size_t channel, const LightImage& from, LightImage& to) {
    for (std::size_t i = 0; i < to.pixels.size(); ++i) to.pixels[i][channel] = from.pixels[i][channel];
  }
  double gain_of(std::size_t index) const {
    const double automatic = gains_.empty() ? 1.0 : gains_[index - first_frame_];
    return automatic * exposure_gain(formation_, frames_.poses[index].time_s);
  }
  ShutterPoses poses_of(std::size_t index, double gain) const {
    const StampedPose& pose = frames_.poses[index];
    if (!has_shutter(formation_)) return {1, 1, {pose.T_local_camera}};
    return shutter_poses(formation_, pose_at_, pose.time_s, renderer_.camera().height(), gain);
  }
  /// At the middle of the exposure, whatever its length; empty beyond the last frame.
  std::vector<SE3> rows_of(std::size_t index) const {
    if (index >= frames_.size()) return {};
    const ShutterPoses poses = poses_of(index, 1.0);
    const auto first = poses.T_local_camera.begin() + static_cast<std::ptrdiff_t>(poses.times / 2) * poses.rows;
    return {first, first + poses.rows};
  }

  const scene::Scene& scene_;
  RenderOptions in_air_;
  CameraRenderer renderer_;
  OutputRenderer outputs_;
  bool has_outputs_;
  const Trajectory& frames_;
  std::size_t first_frame_;
  ImageFormation formation_;
  PoseFunction path_;     // as given; may be empty
  PoseFunction pose_at_;  // for the shutter
  double clearance_m_;
  imaging::FloatImage vignette_;
  std::optional<CameraRenderer> red_, blue_;  ///< where their image is of another size
  std::optional<ExposureState> exposure_;
  std::vector<double> gains_;  ///< the automatic exposure's, from first_frame_ on; empty: there is none
};

/// "frame 3", "frames 3 to 7".
std::string range_name(std::size_t first, std::size_t last) {
  if (first == last) return "frame " + std::to_string(first);
  return "frames " + std::to_string(first) + " to " + std::to_string(last);
}

using Checks = std::span<const std::optional<FrameCheck>>;

template <class Found>
std::vector<std::size_t> frames_where(Checks checks, std::size_t first_frame, const Found& found) {
  std::vector<std::size_t> frames;
  for (std::size_t i = 0; i < checks.size(); ++i) {
    if (checks[i] && found(*checks[i])) frames.push_back(first_frame + i);
  }
  return frames;
}

FlightReport report_of(Checks checks, double seconds) {
  FlightReport report;
  report.seconds = seconds;
  report.nearest_m = std::numeric_limits<double>::infinity();
  for (const std::optional<FrameCheck>& check : checks) {
    if (!check) continue;
    ++report.frames;
    report.mean_surface_share += check->view.surface_share;
    report.nearest_m = std::min(report.nearest_m, check->view.nearest_m);
  }
  if (report.frames > 0) report.mean_surface_share /= static_cast<double>(report.frames);
  report.frames_per_second = seconds > 0.0 ? static_cast<double>(report.frames) / seconds : 0.0;
  return report;
}

}  // namespace

std::vector<FlightFault> flight_faults(Checks checks, std::size_t first_frame, double clearance_m) {
  std::vector<FlightFault> faults;
  const auto look_for = [&](const std::string& key, const std::string& what, const auto& found) {
    std::vector<std::size_t> frames = frames_where(checks, first_frame, found);
    if (!frames.empty()) faults.push_back({key, what, std::move(frames)});
  };
  std::ostringstream near;
  near << "a surface is nearer to the camera than " << clearance_m << " m";
  look_for("camera_near_surface", near.str(), [&](const FrameCheck& check) {
    return std::min(check.view.nearest_m, check.around.clearance_m) < clearance_m;
  });
  look_for("no_surface_in_view", "no surface is in view",
           [](const FrameCheck& check) { return check.view.surface_share == 0.0; });
  look_for("camera_inside_surface", "the camera is inside or under a surface",
           [](const FrameCheck& check) { return check.around.inside; });
  look_for("surfaces_seen_from_behind", "most surfaces are seen from behind; is the camera inside something?",
           [](const FrameCheck& check) { return check.view.back_share > 0.5 && !check.around.inside; });
  look_for("path_through_surface", "the path to the next frame goes through a surface",
           [](const FrameCheck& check) { return check.path_is_blocked; });
  return faults;
}

std::vector<std::string> flight_warnings(Checks checks, std::size_t first_frame, double clearance_m) {
  std::vector<std::string> warnings;
  for (const FlightFault& fault : flight_faults(checks, first_frame, clearance_m)) {
    for (std::size_t i = 0; i < fault.frames.size(); ++i) {
      const std::size_t first = fault.frames[i];
      while (i + 1 < fault.frames.size() && fault.frames[i + 1] == fault.frames[i] + 1) ++i;
      warnings.push_back(range_name(first, fault.frames[i]) + ": " + fault.what);
    }
  }
  return warnings;
}

FlightReport render_flight(const scene::Scene& scene, const imaging::Camera& camera, const Trajectory& frames,
                           const PoseFunction& pose_at, const FlightOptions& options, const FrameSink& sink,
                           const Progress& progress) {
  check(options.formation);
  if (frames.empty()) throw InputError("flight", "there are no frames to render");
  if (options.frames_in_flight < 1) throw InputError("frames in flight", "must be at least 1");
  const auto start = std::chrono::steady_clock::now();
  const FrameMaker maker(scene, camera, frames, pose_at, options);
  const FrameRange range = range_of(options, frames.size());
  std::vector<std::optional<FrameCheck>> checks(range.count());
  std::size_t next = range.begin;
  // Of the flight, or of those of this part that are wanted.
  std::int64_t done = options.wanted ? 0 : static_cast<std::int64_t>(range.begin);
  const std::int64_t total = options.wanted ? wanted_in(range, options) : static_cast<std::int64_t>(frames.size());
  std::mutex progress_mutex;

  const auto take = [&](tbb::flow_control& flow) -> std::size_t {
    while (next < range.end && options.wanted && !options.wanted(next)) ++next;
    if (next == range.end) flow.stop();
    return next++;
  };
  const auto make = [&](std::size_t index) -> SensedFrame {
    SensedFrame frame = maker.make(index);
    checks[index - range.begin] = frame.check;
    return frame;
  };
  const auto hand_over = [&](const SensedFrame& frame) {
    sink(frame);
    const std::scoped_lock lock(progress_mutex);
    report_progress(progress, ++done, total, "frames rendered");
  };
  // While one thread encodes a frame, the others render tiles of the next ones; the tokens bound the memory.
  tbb::parallel_pipeline(static_cast<std::size_t>(options.frames_in_flight),
                         tbb::make_filter<void, std::size_t>(tbb::filter_mode::serial_in_order, take) &
                             tbb::make_filter<std::size_t, SensedFrame>(tbb::filter_mode::parallel, make) &
                             tbb::make_filter<SensedFrame, void>(tbb::filter_mode::parallel, hand_over));

  const std::chrono::duration<double> seconds = std::chrono::steady_clock::now() - start;
  FlightReport report = report_of(checks, seconds.count());
  report.exposure_after = maker.exposure_after();
  report.warnings = flight_warnings(checks, range.begin, options.clearance_m);
  return report;
}

}  // namespace tileflight::sensors
