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

/// Returns the range of FlightRenderOptions::first_frame and end_frame, clipped to a flight of this many frames.
FrameRange frame_range(const FlightRenderOptions& options, std::size_t frames);

/// Returns the options of a camera's images, with the formation's light and haze, and the depth that rain and snow
/// need.
RenderOptions make_render_options(const FlightRenderOptions& options);

/// Returns the scene of a place with its placed parts, from one time to another; nullopt if there are none.
std::optional<scene::Scene> with_placed_parts(const scene::Scene& place, const PlacedParts& placed, double from_s,
                                              double to_s);

/// Returns points of the camera's way from a frame to the next (FrameCheck::path_is_blocked): along the path, if
/// `pose_at` is given, in steps small enough to follow its bends. Precondition: there is a next frame.
std::vector<geometry::Vec3> path_to_next_frame(const geometry::Trajectory& frames, std::size_t index,
                                               const PoseFunction& pose_at);

/// Renders frames of a flight in a scene; several threads may each render one. What is passed by reference must outlive
/// it. With an automatic exposure whose gains are not given, it meters all frames of the range when it is made.
class FrameRenderer {
 public:
  FrameRenderer(const scene::Scene& scene, const imaging::Camera& camera, const geometry::Trajectory& frames,
                const PoseFunction& pose_at, const FlightRenderOptions& options);

  /// State after the last frame of the range; nullopt without automatic exposure.
  const std::optional<AutoExposureState>& exposure_after() const { return exposure_; }

  /// Renders a frame and checks the camera's path at it. Where no effect needs a pixel's neighbours, light becomes
  /// pixels as soon as it is known, and the frame's light is not kept.
  FlightFrame render(std::size_t index) const;

 private:
  void meter(const scene::Scene& scene, const RenderOptions& options, const FrameRange& range);
  struct Moment;
  struct Cameras;
  bool develops_at_once() const;
  LinearImage trace(std::size_t index, FlightFrame& frame) const;
  LinearImage trace_picture(const Cameras& cameras, const Moment& moment, const SurfaceVisitor& visitor,
                            FlightFrame& frame) const;
  imaging::RgbImage expose_picture(const Cameras& cameras, const Moment& moment, const SurfaceVisitor& visitor,
                                   FlightFrame& frame) const;
  LightFrame trace_light(const Cameras& cameras, const ShutterPoses& poses, const SurfaceVisitor& visitor) const;
  void check_path(FlightFrame& frame) const;
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
  imaging::FloatImage vignette_;
  std::optional<CameraRenderer> red_, blue_;  ///< set if the channel's image has another scale
  std::optional<AutoExposureState> exposure_;
  std::vector<double> gains_;  ///< of the automatic exposure, from first_frame_ on; empty: none
};

}  // namespace tileflight::render
