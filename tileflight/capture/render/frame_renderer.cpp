#include "tileflight/capture/render/frame_renderer.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <utility>

#include "tileflight/capture/flight_path/path.h"
#include "tileflight/capture/render/appearance.h"

namespace tileflight::render {
namespace {

using geometry::SE3;
using geometry::StampedPose;
using geometry::Trajectory;

bool has_shutter(const ImageFormation& formation) {
  return formation.exposure_time_s > 0.0 || formation.line_delay_s != 0.0;
}

/// Poses for the shutter: the given function, else a spline through the frames.
PoseFunction shutter_path(const PoseFunction& pose_at, const Trajectory& frames, bool is_needed) {
  if (pose_at || !is_needed) return pose_at;
  if (frames.size() == 1) return [T = frames.poses[0].T_local_camera](double) { return T; };
  return [path = flight_path::path_through_poses(frames)](double time_s) { return path.pose(time_s); };
}

bool has_precipitation(const RenderOptions& options) { return options.weather && options.weather->has_precipitation(); }

std::shared_ptr<const Appearance> appearance_of(const scene::Scene& scene,
                                                const std::optional<scene::Scene>& with_placed,
                                                const FlightRenderOptions& options) {
  if (options.appearance && !with_placed) return options.appearance;
  return std::make_shared<const Appearance>(with_placed ? *with_placed : scene);
}

void take_channel(std::size_t channel, const LinearImage& from, LinearImage& to) {
  for (std::size_t i = 0; i < to.pixels.size(); ++i) to.pixels[i][channel] = from.pixels[i][channel];
}

}  // namespace

RenderOptions make_render_options(const FlightRenderOptions& options) {
  const ImageFormation& formation = options.formation;
  RenderOptions render = options.render;
  render.haze_per_m = haze_per_m(formation);
  render.haze_color = formation.haze_color;
  if (formation.light) render.daylight = make_daylight(*formation.light, options.origin);
  render.depth = render.depth || has_precipitation(render);
  return render;
}

std::optional<scene::Scene> with_placed_parts(const scene::Scene& place, const PlacedParts& placed, double from_s,
                                              double to_s) {
  if (!placed) return std::nullopt;
  std::vector<scene::PlacedPart> parts = placed(from_s, to_s);
  if (parts.empty()) return std::nullopt;
  return scene::Scene(place.parts(), std::move(parts));
}

std::vector<geometry::Vec3> path_to_next_frame(const Trajectory& frames, std::size_t index,
                                               const PoseFunction& pose_at) {
  constexpr double kStep_m = 0.5, kMostSteps = 32.0;
  const StampedPose &from = frames.poses[index], &to = frames.poses[index + 1];
  std::vector<geometry::Vec3> way{from.T_local_camera.translation};
  const double length_m = (to.T_local_camera.translation - way.front()).norm();
  const int steps = pose_at ? static_cast<int>(std::clamp(std::ceil(length_m / kStep_m), 1.0, kMostSteps)) : 1;
  for (int k = 1; k < steps; ++k)
    way.push_back(pose_at(from.time_s + (to.time_s - from.time_s) * k / steps).translation);
  way.push_back(to.T_local_camera.translation);
  return way;
}

FrameRange frame_range(const FlightRenderOptions& options, std::size_t frames) {
  const std::size_t end = std::min(options.end_frame, frames);
  return {std::min(options.first_frame, end), end};
}

FrameRenderer::FrameRenderer(const scene::Scene& scene, const imaging::Camera& camera, const Trajectory& frames,
                             const PoseFunction& pose_at, const FlightRenderOptions& options)
    : scene_(scene),
      render_options_(make_render_options(options)),
      placed_(options.placed),
      with_placed_(with_placed_parts(scene, placed_, frames.poses.front().time_s, frames.poses.front().time_s)),
      renderer_(with_placed_ ? *with_placed_ : scene, appearance_of(scene, with_placed_, options), camera,
                render_options_),
      outputs_(renderer_, with_placed_ ? *with_placed_ : scene, options.outputs, options.scored_region),
      has_outputs_(options.outputs.any()),
      has_depth_(options.render.depth),
      frames_(frames),
      first_frame_(frame_range(options, frames.size()).begin),
      formation_(options.formation),
      path_(pose_at),
      pose_at_(shutter_path(pose_at, frames, has_shutter(options.formation) || has_precipitation(options.render))),
      clearance_m_(options.clearance_m),
      inside_reach_m_(options.inside_reach_m),
      vignette_(make_vignette(formation_, camera.width(), camera.height())),
      exposure_(options.exposure_before) {
  if (has_precipitation(render_options_)) streaks_.emplace(render_options_, scene.anchor().z());
  RenderOptions colour = render_options_;
  colour.depth = false;
  const auto with_lens = [&](double larger, std::optional<CameraRenderer>& renderer) {
    if (larger == 0.0) return;
    renderer.emplace(with_placed_ ? *with_placed_ : scene, renderer_.appearance(), scale_focal_length(camera, larger),
                     colour);
  };
  with_lens(formation_.chromatic_red, red_);
  with_lens(formation_.chromatic_blue, blue_);
  const FrameRange range = frame_range(options, frames.size());
  if (!options.exposure_gains.empty()) {
    const auto first = options.exposure_gains.begin() + static_cast<std::ptrdiff_t>(range.begin);
    gains_.assign(first, first + static_cast<std::ptrdiff_t>(range.count()));
  } else if (formation_.auto_exposure.target > 0.0) {
    meter(scene, colour, range);
  }
}

/// Whether a pixel of a frame is what its own light becomes.
bool FrameRenderer::develops_at_once() const {
  return !is_ideal(formation_) && !streaks_ && !red_ && !blue_ && formation_.sharpening == 0.0;
}

FlightFrame FrameRenderer::render(std::size_t index) const {
  FlightFrame frame;
  frame.index = index;
  frame.time_s = frames_.poses[index].time_s;
  frame.exposure_ms = 1e3 * formation_.exposure_time_s * gain_of(index);
  const LinearImage light = trace(index, frame);
  if (!light.empty()) frame.rgb = develop(light, vignette_, formation_, gain_of(index), index);
  check_path(frame);
  return frame;
}

/// Looks around the camera, and along its way to the next frame.
void FrameRenderer::check_path(FlightFrame& frame) const {
  const geometry::Vec3& here = frames_.poses[frame.index].T_local_camera.translation;
  frame.check.surroundings = scene::find_surroundings(scene_, here, clearance_m_, inside_reach_m_);
  frame.check.path_is_blocked = frame.index + 1 < frames_.size() &&
                                scene::path_hits_surface(scene_, path_to_next_frame(frames_, frame.index, path_));
}

/// Computes the automatic exposure's gains of all frames, before the first is rendered.
void FrameRenderer::meter(const scene::Scene& scene, const RenderOptions& options, const FrameRange& range) {
  const std::span<const StampedPose> poses = std::span(frames_.poses).subspan(range.begin, range.count());
  std::vector<double> times_s;
  for (const StampedPose& pose : poses) times_s.push_back(pose.time_s);
  const std::vector<double> light =
      meter_light(scene, renderer_.appearance(), renderer_.camera(), options, formation_, poses);
  gains_ = exposure_gains(formation_.auto_exposure, times_s, light, exposure_);
}

/// A frame's poses, and the scene while its shutter is open.
struct FrameRenderer::Moment {
  ShutterPoses rows;                  ///< at the middle of the exposure
  ShutterPoses exposure;              ///< all of it
  std::optional<scene::Scene> scene;  ///< if any parts are placed
};

/// The renderers of a frame: this object's own, or those in the frame's scene.
struct FrameRenderer::Cameras {
  const CameraRenderer *all, *red, *blue;  ///< red, blue: null if they are as all
  std::vector<std::unique_ptr<const CameraRenderer>> own{};
};

FrameRenderer::Cameras FrameRenderer::cameras_in(const scene::Scene* scene) const {
  const auto address = [](const std::optional<CameraRenderer>& one) { return one ? &*one : nullptr; };
  Cameras cameras{&renderer_, address(red_), address(blue_)};
  if (scene == nullptr) return cameras;
  for (const CameraRenderer** camera : {&cameras.all, &cameras.red, &cameras.blue}) {
    if (*camera == nullptr) continue;
    cameras.own.push_back(std::make_unique<const CameraRenderer>(*scene, renderer_.appearance(), (*camera)->rays(),
                                                                 (*camera)->options()));
    *camera = cameras.own.back().get();
  }
  return cameras;
}

/// Without exposure only the rows, which do not depend on the gain: the next frame's may not be known here.
FrameRenderer::Moment FrameRenderer::moment_of(std::size_t index, bool is_exposed) const {
  Moment moment{rows_of(index), {}, {}};
  if (index >= frames_.size()) return moment;
  if (is_exposed) moment.exposure = poses_of(index, gain_of(index));
  if (!with_placed_) return moment;
  double from_s = frames_.poses[index].time_s, to_s = from_s;
  for (const ShutterPoses* poses : {&moment.rows, &moment.exposure}) {
    for (const double time_s : poses->times_s) {
      from_s = std::min(from_s, time_s);
      to_s = std::max(to_s, time_s);
    }
  }
  for (ShutterPoses* poses : {&moment.rows, &moment.exposure}) {
    for (const double time_s : poses->times_s)
      poses->scene_times.push_back(to_s > from_s ? static_cast<float>((time_s - from_s) / (to_s - from_s)) : 0.0F);
  }
  moment.scene = with_placed_parts(scene_, placed_, from_s, to_s);
  return moment;
}

/// Sets the frame's image and outputs. Returns its light before exposure, if that is still to be developed.
LinearImage FrameRenderer::trace(std::size_t index, FlightFrame& frame) const {
  const Moment moment = moment_of(index, true);
  const Cameras cameras = cameras_in(moment.scene ? &*moment.scene : nullptr);
  LinearImage light;
  const auto trace = [&](const SurfaceVisitor& visitor) {
    light = trace_picture(cameras, moment, visitor, frame);
    if (!streaks_) return;
    streaks_->draw(renderer_.camera(), streak_shutter(index), frame.depth_m, light);
    if (!has_depth_) frame.depth_m = {};  // only the streaks needed it
  };
  if (!has_outputs_) {
    trace({});
    return light;
  }
  const Moment next = moment_of(index + 1, false);
  const MovingFrame moving{moment.scene ? &*moment.scene : nullptr, moment.rows.scene_times,
                           next.scene ? &*next.scene : nullptr, next.rows.scene_times};
  frame.outputs = outputs_.render(*cameras.all, moment.rows.T_local_camera, next.rows.T_local_camera, moving, trace);
  frame.objects = outputs_.objects();
  return light;
}

/// Colour and depth of a frame. The middle moment of the exposure has the rows' poses, so `visitor` sees what the
/// frame's outputs are of. Returns the light if the image is not made of it at once.
LinearImage FrameRenderer::trace_picture(const Cameras& cameras, const Moment& moment, const SurfaceVisitor& visitor,
                                         FlightFrame& frame) const {
  if (develops_at_once()) {
    frame.rgb = expose_picture(cameras, moment, visitor, frame);
    return {};
  }
  if (is_ideal(formation_) && !streaks_) {
    RenderedFrame rendered = cameras.all->render(frames_.poses[frame.index].T_local_camera, visitor);
    frame.rgb = std::move(rendered.rgb);
    frame.depth_m = std::move(rendered.depth_m);
    frame.check.view = rendered.view;
    return {};
  }
  LightFrame light = trace_light(cameras, moment.exposure, visitor);
  frame.depth_m = std::move(light.depth_m);
  frame.check.view = light.view;
  return std::move(light.light);
}

/// The frame's pixels; its depth and view are written to `frame`.
imaging::RgbImage FrameRenderer::expose_picture(const Cameras& cameras, const Moment& moment,
                                                const SurfaceVisitor& visitor, FlightFrame& frame) const {
  const imaging::Camera& camera = renderer_.camera();
  imaging::RgbImage rgb(camera.width(), camera.height());
  const Developer expose = make_developer(vignette_, formation_, gain_of(frame.index), frame.index);
  LightFrame rest = cameras.all->render_light(
      moment.exposure, visitor, [&](int x, int y, std::span<const LinearRgb> light) { expose(x, y, light, rgb); });
  frame.depth_m = std::move(rest.depth_m);
  frame.check.view = rest.view;
  return rgb;
}

/// Renders red and blue through separate lenses if there is chromatic aberration.
LightFrame FrameRenderer::trace_light(const Cameras& cameras, const ShutterPoses& poses,
                                      const SurfaceVisitor& visitor) const {
  LightFrame light = cameras.all->render_light(poses, visitor);
  if (cameras.red != nullptr) take_channel(0, cameras.red->render_light(poses).light, light.light);
  if (cameras.blue != nullptr) take_channel(2, cameras.blue->render_light(poses).light, light.light);
  return light;
}

double FrameRenderer::gain_of(std::size_t index) const {
  const double automatic = gains_.empty() ? 1.0 : gains_[index - first_frame_];
  return automatic * exposure_gain(formation_, frames_.poses[index].time_s);
}

ShutterPoses FrameRenderer::poses_of(std::size_t index, double gain) const {
  const StampedPose& pose = frames_.poses[index];
  if (!has_shutter(formation_)) return {1, 1, {pose.T_local_camera}, {}, {pose.time_s}};
  return shutter_poses(formation_, pose_at_, pose.time_s, renderer_.camera().height(), gain);
}

/// The camera's own shutter, or that of the weather for a camera whose exposure takes no time.
StreakShutter FrameRenderer::streak_shutter(std::size_t index) const {
  const double open_s = formation_.exposure_time_s > 0.0 ? formation_.exposure_time_s * gain_of(index)
                                                         : render_options_.weather->streak_exposure_s;
  return {pose_at_, frames_.poses[index].time_s, open_s, formation_.line_delay_s, render_options_.weather_offset_s};
}

/// At the middle of the exposure: one moment; empty beyond the last frame.
ShutterPoses FrameRenderer::rows_of(std::size_t index) const {
  if (index >= frames_.size()) return {};
  const ShutterPoses poses = poses_of(index, 1.0);
  const auto first = static_cast<std::ptrdiff_t>(poses.moments / 2) * poses.rows, last = first + poses.rows;
  return {1,
          poses.rows,
          {poses.T_local_camera.begin() + first, poses.T_local_camera.begin() + last},
          {},
          {poses.times_s.begin() + first, poses.times_s.begin() + last}};
}

std::vector<double> meter_flight(const scene::Scene& scene, const imaging::Camera& camera, const Trajectory& frames,
                                 const FlightRenderOptions& options) {
  const FrameRange range = frame_range(options, frames.size());
  return meter_light(scene, appearance_of(scene, {}, options), camera, make_render_options(options), options.formation,
                     std::span(frames.poses).subspan(range.begin, range.count()));
}

}  // namespace tileflight::render
