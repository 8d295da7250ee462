#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <vector>

#include "tileflight/capture/render/auto_exposure.h"
#include "tileflight/capture/render/camera_renderer.h"
#include "tileflight/capture/render/frame_outputs.h"
#include "tileflight/capture/render/image_formation.h"
#include "tileflight/capture/render/render_flight.h"
#include "tileflight/capture/render/streaks.h"
#include "tileflight/core/geometry/trajectory.h"
#include "tileflight/world/scene/clearance.h"

namespace tileflight::render {

/// Range of frames of a flight.
struct FrameRange {
  std::size_t begin = 0;
  std::size_t end = 0;  ///< not included

  std::size_t count() const { return end - begin; }
};

/// FlightRenderOptions::first_frame and end_frame, clipped to a flight of this many frames.
FrameRange frame_range(const FlightRenderOptions& options, std::size_t frames);

/// The options of a camera's pictures: with the formation's light and haze, and the depth that rain and snow need.
RenderOptions make_render_options(const FlightRenderOptions& options);

/// The place with what is placed in it, from one time to another; nullopt: nothing is.
std::optional<scene::Scene> with_placed_parts(const scene::Scene& place, const PlacedParts& placed, double from_s,
                                              double to_s);

/// Points of the camera's way from a frame to the next (FrameCheck::path_is_blocked): along the path, if `pose_at` is
/// given, in steps small enough to follow its bends. Precondition: there is a next frame.
std::vector<geometry::Vec3> path_to_next_frame(const geometry::Trajectory& frames, std::size_t index,
                                               const PoseFunction& pose_at);

/// What tells of the camera's path at a frame (FrameCheck), as found in a scene, and added where several scenes each
/// hold some of the place's surfaces.
struct PathCheck {
  scene::SurroundingRays around;
  bool is_blocked = false;  ///< FrameCheck::path_is_blocked

  void add(const PathCheck& other);
  void write_to(FrameCheck& check) const;
};

/// Looks around the camera, and along its way to the next frame (path_to_next_frame). `clearance_m`, `inside_reach_m`:
/// FlightRenderOptions.
PathCheck check_path(const scene::Scene& scene, const geometry::Trajectory& frames, std::size_t index,
                     const PoseFunction& pose_at, double clearance_m, double inside_reach_m);

/// What rays find of a frame: all that depends on the scene.
struct TracedFrame {
  std::size_t index = 0;
  imaging::RgbImage rgb;  ///< with an ideal image formation and nothing that falls, or if developed; else empty
  LinearImage light;      ///< before exposure, in all other cases; else empty
  imaging::FloatImage depth_m;
  OutputImages outputs;
  std::span<const SceneObject> objects;  ///< of outputs.objects; valid as long as the renderer
  FrameCheck check;
};

/// A frame as it looks in a scene with some of a place's meshes, or with what is placed in it, for LayeredFrame.
struct TracedLayer {
  TracedFrame frame;
  imaging::Image<LayerSurface> surfaces;
  std::uint32_t first_placed_mesh = LayerSurface::kNone;  ///< of the layer's scene
};

/// Whether each pixel of a frame is what one ray finds, so that frames can be traced in layers: one sample a pixel, one
/// moment of exposure, and one lens for all colours. (What falls is drawn before the surfaces of all layers.)
bool has_one_ray_per_pixel(const FlightRenderOptions& options);

/// Renders frames of a flight in a scene; several threads may each render one. What is passed by reference must outlive
/// it. With an automatic exposure whose gains are not given, it meters all frames of the range when it is made.
class FrameRenderer {
 public:
  FrameRenderer(const scene::Scene& scene, const imaging::Camera& camera, const geometry::Trajectory& frames,
                const PoseFunction& pose_at, const FlightRenderOptions& options);

  /// State after the last frame of the range; nullopt without automatic exposure.
  const std::optional<AutoExposureState>& exposure_after() const { return exposure_; }

  /// A frame with its checks.
  TracedFrame trace(std::size_t index) const;
  /// A region of the frame (see CameraRenderer), for DividedFrame; of its checks, only the region's view.
  TracedFrame trace_region(std::size_t index, const OptionalRegion& region) const {
    return trace_rays(index, region, {});
  }
  /// A layer of the frame, for LayeredFrame, without checks, and without what falls. Precondition:
  /// has_one_ray_per_pixel() of the options.
  TracedLayer trace_layer(std::size_t index) const;
  /// Completes the sum of all layers: draws what falls. `anchor_z_m`: of the layers' scenes; this one is not used.
  void finish_layers(TracedFrame& frame, double anchor_z_m) const;
  /// Exposes a frame. Does not use the scene.
  FlightFrame develop(TracedFrame traced) const;
  /// develop() of trace(). Where no effect needs a pixel's neighbours, light becomes pixels as soon as it is known, and
  /// the frame's light is not kept.
  FlightFrame render(std::size_t index) const;

 private:
  void meter(const scene::Scene& scene, const RenderOptions& options, const FrameRange& range);
  struct Moment;
  struct Cameras;
  struct Trace {
    imaging::Image<LayerSurface>* surfaces = nullptr;  ///< what the rays meet is written there, too
    bool is_developed = false;                         ///< TracedFrame::rgb instead of TracedFrame::light
  };
  bool develops_at_once() const;
  TracedFrame trace_whole(std::size_t index, const Trace& how) const;
  TracedFrame trace_rays(std::size_t index, const OptionalRegion& region, const Trace& how) const;
  void trace_picture(const Cameras& cameras, const Moment& moment, const OptionalRegion& region,
                     const SurfaceVisitor& visitor, bool is_developed, TracedFrame& frame) const;
  imaging::RgbImage expose_picture(const Cameras& cameras, const Moment& moment, const OptionalRegion& region,
                                   const SurfaceVisitor& visitor, TracedFrame& frame) const;
  void draw_streaks(const StreakRenderer& streaks, const OptionalRegion& region, TracedFrame& frame) const;
  LightFrame trace_light(const Cameras& cameras, const ShutterPoses& poses, const OptionalRegion& region,
                         const SurfaceVisitor& visitor) const;
  Moment moment_of(std::size_t index, bool is_exposed) const;
  Cameras cameras_in(const scene::Scene* scene) const;
  double gain_of(std::size_t index) const;
  ShutterPoses poses_of(std::size_t index, double gain) const;
  ShutterPoses rows_of(std::size_t index) const;
  StreakShutter streak_shutter(std::size_t index) const;

  const scene::Scene& scene_;
  RenderOptions render_options_;
  PlacedParts placed_;
  std::optional<scene::Scene> with_placed_;  ///< at some time, for what does not depend on poses; set if any are placed
  CameraRenderer renderer_;
  OutputRenderer outputs_;
  bool has_outputs_;
  bool has_depth_;                         ///< of the frames that are handed out
  std::optional<StreakRenderer> streaks_;  ///< set if it rains or snows
  const geometry::Trajectory& frames_;
  std::size_t first_frame_;
  ImageFormation formation_;
  PoseFunction path_;     // as given; may be empty
  PoseFunction pose_at_;  // for the shutter
  double clearance_m_, inside_reach_m_;
  std::function<void(std::size_t index, FrameCheck& check)> known_path_check_;  ///< FlightRenderOptions::path_check
  imaging::FloatImage vignette_;
  std::optional<CameraRenderer> red_, blue_;  ///< set if the channel's image has another scale
  std::optional<AutoExposureState> exposure_;
  std::vector<double> gains_;  ///< of the automatic exposure, from first_frame_ on; empty: none
};

/// The light meter of a flight's automatic exposure.
LightMeter make_light_meter(const scene::Scene& scene, const imaging::Camera& camera,
                            const FlightRenderOptions& options);

}  // namespace tileflight::render
