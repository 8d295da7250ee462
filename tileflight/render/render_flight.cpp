#include "tileflight/render/render_flight.h"

#include <tbb/parallel_pipeline.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <mutex>
#include <optional>
#include <sstream>
#include <utility>

#include "tileflight/base/input_error.h"
#include "tileflight/flight/path.h"

namespace tileflight::render {
namespace {

using geometry::SE3;
using geometry::StampedPose;
using geometry::Trajectory;

bool has_shutter(const ImageFormation& formation) {
  return formation.exposure_time_s > 0.0 || formation.line_delay_s != 0.0;
}

/// Poses for the shutter: the given function, else a spline through the frames.
PoseFunction shutter_path(const PoseFunction& pose_at, const Trajectory& frames, const ImageFormation& formation) {
  if (pose_at || !has_shutter(formation)) return pose_at;
  if (frames.size() == 1) return [T = frames.poses[0].T_local_camera](double) { return T; };
  return [path = flight::path_through_poses(frames)](double time_s) { return path.pose(time_s); };
}

/// Range of frames to render.
struct FrameRange {
  std::size_t begin = 0;
  std::size_t end = 0;

  std::size_t count() const { return end - begin; }
};

FrameRange range_of(const FlightRenderOptions& options, std::size_t frames) {
  const std::size_t end = std::min(options.end_frame, frames);
  return {std::min(options.first_frame, end), end};
}

std::int64_t count_selected(const FrameRange& range, const FlightRenderOptions& options) {
  std::int64_t count = 0;
  for (std::size_t i = range.begin; i < range.end; ++i) count += options.frame_filter(i) ? 1 : 0;
  return count;
}

/// Render options with the formation's light and haze.
RenderOptions make_render_options(const FlightRenderOptions& options) {
  const ImageFormation& formation = options.formation;
  RenderOptions render = options.render;
  render.haze_per_m = haze_per_m(formation);
  render.haze_color = formation.haze_color;
  if (formation.light) render.daylight = make_daylight(*formation.light, options.origin);
  return render;
}

/// Points from one frame to the next: along the path, if known, in steps small enough to follow its bends.
std::vector<geometry::Vec3> path_between(const StampedPose& from, const StampedPose& to, const PoseFunction& pose_at) {
  constexpr double kStep_m = 0.5, kMostSteps = 32.0;
  std::vector<geometry::Vec3> way{from.T_local_camera.translation};
  const double length_m = (to.T_local_camera.translation - way.front()).norm();
  const int steps = pose_at ? static_cast<int>(std::clamp(std::ceil(length_m / kStep_m), 1.0, kMostSteps)) : 1;
  for (int k = 1; k < steps; ++k)
    way.push_back(pose_at(from.time_s + (to.time_s - from.time_s) * k / steps).translation);
  way.push_back(to.T_local_camera.translation);
  return way;
}

/// Renders frames; several threads may each render one.
class FrameRenderer {
 public:
  FrameRenderer(const scene::Scene& scene, const imaging::Camera& camera, const Trajectory& frames,
                const PoseFunction& pose_at, const FlightRenderOptions& options)
      : scene_(scene),
        render_options_(make_render_options(options)),
        renderer_(scene, camera, render_options_),
        outputs_(renderer_, scene, options.outputs, options.scored_region),
        has_outputs_(options.outputs.any()),
        frames_(frames),
        first_frame_(range_of(options, frames.size()).begin),
        formation_(options.formation),
        path_(pose_at),
        pose_at_(shutter_path(pose_at, frames, options.formation)),
        clearance_m_(options.clearance_m),
        inside_reach_m_(options.inside_reach_m),
        vignette_(make_vignette(formation_, camera.width(), camera.height())),
        exposure_(options.exposure_before) {
    RenderOptions colour = render_options_;
    colour.depth = false;
    const auto with_lens = [&](double larger, std::optional<CameraRenderer>& renderer) {
      if (larger != 0.0) renderer.emplace(scene, renderer_.appearance(), scale_focal_length(camera, larger), colour);
    };
    with_lens(formation_.chromatic_red, red_);
    with_lens(formation_.chromatic_blue, blue_);
    const FrameRange range = range_of(options, frames.size());
    if (!options.exposure_gains.empty()) {
      const auto first = options.exposure_gains.begin() + static_cast<std::ptrdiff_t>(range.begin);
      gains_.assign(first, first + static_cast<std::ptrdiff_t>(range.count()));
    } else if (formation_.auto_exposure.target > 0.0) {
      meter(scene, colour, range);
    }
  }

  /// State after the last frame of the range; nullopt without automatic exposure.
  const std::optional<AutoExposureState>& exposure_after() const { return exposure_; }

  FlightFrame render(std::size_t index) const {
    FlightFrame frame;
    frame.index = index;
    frame.time_s = frames_.poses[index].time_s;
    frame.exposure_ms = 1e3 * formation_.exposure_time_s * gain_of(index);
    render_image(frame);
    if (has_outputs_) {
      frame.outputs = outputs_.render(rows_of(index), rows_of(index + 1));
      frame.objects = outputs_.objects();
    }
    frame.check.surroundings = scene::find_surroundings(scene_, frames_.poses[index].T_local_camera.translation,
                                                        clearance_m_, inside_reach_m_);
    frame.check.path_is_blocked = is_blocked_after(index);
    return frame;
  }

 private:
  /// Computes the automatic exposure's gains of all frames, before the first is rendered.
  void meter(const scene::Scene& scene, const RenderOptions& options, const FrameRange& range) {
    const std::span<const StampedPose> poses = std::span(frames_.poses).subspan(range.begin, range.count());
    std::vector<double> times_s;
    for (const StampedPose& pose : poses) times_s.push_back(pose.time_s);
    const std::vector<double> light =
        meter_light(scene, renderer_.appearance(), renderer_.camera(), options, formation_, poses);
    gains_ = exposure_gains(formation_.auto_exposure, times_s, light, exposure_);
  }
  void render_image(FlightFrame& frame) const {
    if (is_ideal(formation_)) {
      RenderedFrame rendered = renderer_.render(frames_.poses[frame.index].T_local_camera);
      frame.rgb = std::move(rendered.rgb);
      frame.depth_m = std::move(rendered.depth_m);
      frame.check.view = rendered.view;
      return;
    }
    LightFrame light = render_light(frame.index);
    frame.rgb = develop(light.light, vignette_, formation_, gain_of(frame.index), frame.index);
    frame.depth_m = std::move(light.depth_m);
    frame.check.view = light.view;
  }
  /// Renders red and blue through separate lenses if there is chromatic aberration.
  LightFrame render_light(std::size_t index) const {
    const ShutterPoses poses = poses_of(index, gain_of(index));
    LightFrame light = renderer_.render_light(poses);
    if (red_) take_channel(0, red_->render_light(poses).light, light.light);
    if (blue_) take_channel(2, blue_->render_light(poses).light, light.light);
    return light;
  }
  bool is_blocked_after(std::size_t index) const {
    const auto& poses = frames_.poses;
    return index + 1 < poses.size() &&
           scene::path_hits_surface(scene_, path_between(poses[index], poses[index + 1], path_));
  }
  static void take_channel(std::size_t channel, const LinearImage& from, LinearImage& to) {
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
  /// Row poses at the middle of the exposure; empty beyond the last frame.
  std::vector<SE3> rows_of(std::size_t index) const {
    if (index >= frames_.size()) return {};
    const ShutterPoses poses = poses_of(index, 1.0);
    const auto first = poses.T_local_camera.begin() + static_cast<std::ptrdiff_t>(poses.moments / 2) * poses.rows;
    return {first, first + poses.rows};
  }

  const scene::Scene& scene_;
  RenderOptions render_options_;
  CameraRenderer renderer_;
  OutputRenderer outputs_;
  bool has_outputs_;
  const Trajectory& frames_;
  std::size_t first_frame_;
  ImageFormation formation_;
  PoseFunction path_;     // as given; may be empty
  PoseFunction pose_at_;  // for the shutter
  double clearance_m_, inside_reach_m_;
  imaging::FloatImage vignette_;
  std::optional<CameraRenderer> red_, blue_;  ///< set if the channel's image has another scale
  std::optional<AutoExposureState> exposure_;
  std::vector<double> gains_;  ///< of the automatic exposure, from first_frame_ on; empty: none
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

FlightRenderReport report_of(Checks checks, double seconds) {
  FlightRenderReport report;
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

std::vector<FlightFault> find_flight_faults(Checks checks, std::size_t first_frame, double clearance_m) {
  std::vector<FlightFault> faults;
  const auto look_for = [&](const std::string& key, const std::string& what, const auto& found) {
    std::vector<std::size_t> frames = frames_where(checks, first_frame, found);
    if (!frames.empty()) faults.push_back({key, what, std::move(frames)});
  };
  std::ostringstream near;
  near << "a surface is nearer to the camera than " << clearance_m << " m";
  look_for("camera_near_surface", near.str(), [&](const FrameCheck& check) {
    return std::min(check.view.nearest_m, check.surroundings.clearance_m) < clearance_m;
  });
  look_for("no_surface_in_view", "no surface is in view",
           [](const FrameCheck& check) { return check.view.surface_share == 0.0; });
  look_for("camera_inside_surface", "the camera is inside or under a surface",
           [](const FrameCheck& check) { return check.surroundings.inside; });
  look_for("surfaces_seen_from_behind", "most surfaces are seen from behind; is the camera inside something?",
           [](const FrameCheck& check) { return check.view.back_face_share > 0.5 && !check.surroundings.inside; });
  look_for("path_through_surface", "the path to the next frame goes through a surface",
           [](const FrameCheck& check) { return check.path_is_blocked; });
  return faults;
}

std::vector<std::string> flight_warnings(Checks checks, std::size_t first_frame, double clearance_m) {
  std::vector<std::string> warnings;
  for (const FlightFault& fault : find_flight_faults(checks, first_frame, clearance_m)) {
    for (std::size_t i = 0; i < fault.frames.size(); ++i) {
      const std::size_t first = fault.frames[i];
      while (i + 1 < fault.frames.size() && fault.frames[i + 1] == fault.frames[i] + 1) ++i;
      warnings.push_back(range_name(first, fault.frames[i]) + ": " + fault.what);
    }
  }
  return warnings;
}

std::vector<double> meter_flight(const scene::Scene& scene, const imaging::Camera& camera, const Trajectory& frames,
                                 const FlightRenderOptions& options) {
  const FrameRange range = range_of(options, frames.size());
  return meter_light(scene, std::make_shared<const Appearance>(scene), camera, make_render_options(options),
                     options.formation, std::span(frames.poses).subspan(range.begin, range.count()));
}

FlightRenderReport render_flight(const scene::Scene& scene, const imaging::Camera& camera, const Trajectory& frames,
                                 const PoseFunction& pose_at, const FlightRenderOptions& options, const FrameSink& sink,
                                 const Progress& progress) {
  validate_image_formation(options.formation);
  if (frames.empty()) throw InputError("flight", "there are no frames to render");
  if (options.max_frames_in_memory < 1) throw InputError("frames in flight", "must be at least 1");
  const auto start = std::chrono::steady_clock::now();
  const FrameRenderer maker(scene, camera, frames, pose_at, options);
  const FrameRange range = range_of(options, frames.size());
  std::vector<std::optional<FrameCheck>> checks(range.count());
  std::size_t next = range.begin;
  // Counts frames of the whole flight, or only the selected ones if there is a filter.
  std::int64_t done = options.frame_filter ? 0 : static_cast<std::int64_t>(range.begin);
  const std::int64_t total =
      options.frame_filter ? count_selected(range, options) : static_cast<std::int64_t>(frames.size());
  std::mutex progress_mutex;

  const auto take = [&](tbb::flow_control& flow) -> std::size_t {
    while (next < range.end && options.frame_filter && !options.frame_filter(next)) ++next;
    if (next == range.end) flow.stop();
    return next++;
  };
  const auto make = [&](std::size_t index) -> FlightFrame {
    FlightFrame frame = maker.render(index);
    checks[index - range.begin] = frame.check;
    return frame;
  };
  const auto hand_over = [&](const FlightFrame& frame) {
    sink(frame);
    const std::scoped_lock lock(progress_mutex);
    report_progress(progress, ++done, total, "frames rendered");
  };
  // While one thread encodes a frame, others render tiles of the next ones; the tokens limit memory.
  tbb::parallel_pipeline(static_cast<std::size_t>(options.max_frames_in_memory),
                         tbb::make_filter<void, std::size_t>(tbb::filter_mode::serial_in_order, take) &
                             tbb::make_filter<std::size_t, FlightFrame>(tbb::filter_mode::parallel, make) &
                             tbb::make_filter<FlightFrame, void>(tbb::filter_mode::parallel, hand_over));

  const std::chrono::duration<double> seconds = std::chrono::steady_clock::now() - start;
  FlightRenderReport report = report_of(checks, seconds.count());
  report.exposure_after = maker.exposure_after();
  report.warnings = flight_warnings(checks, range.begin, options.clearance_m);
  return report;
}

}  // namespace tileflight::render
