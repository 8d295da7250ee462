#pragma once

#include <cstdint>
#include <functional>
#include <limits>
#include <string>
#include <vector>

#include "tileflight/geometry/progress.h"
#include "tileflight/geometry/trajectory.h"
#include "tileflight/sensors/auto_exposure.h"
#include "tileflight/sensors/frame_outputs.h"
#include "tileflight/sensors/image_formation.h"
#include "tileflight/sensors/render.h"

namespace tileflight::sensors {

struct FlightOptions {
  RenderOptions render;
  ImageFormation formation;
  FrameOutputs outputs;
  std::optional<geometry::Geodetic> origin{};  ///< of the local frame; ImageFormation::light needs it
  PlaceTest place;                             ///< for FrameOutputs::visibility; none: everything counts
  /// Which of the frames are rendered: from `first_frame` on, before `end_frame`. They keep their numbers, and are the
  /// same pictures as those of the whole flight.
  std::size_t first_frame = 0;
  std::size_t end_frame = std::numeric_limits<std::size_t>::max();
  /// Of the automatic exposure, before `first_frame`: FlightReport::exposure_after of the frames before it.
  std::optional<ExposureState> exposure_before{};
  int frames_in_flight = 4;  ///< frames that may be in memory at once, rendered or being written
  double clearance_m = 0.3;  ///< a surface nearer than this to the camera is reported
};

/// A finished frame.
struct SensedFrame {
  std::size_t index = 0;
  double time_s = 0.0;
  double exposure_ms = 0.0;  ///< how long the shutter was open; 0 where the formation has no exposure time
  imaging::RgbImage rgb;
  imaging::FloatImage depth_m;           ///< empty where no depth is wanted
  OutputImages outputs;                  ///< what FlightOptions::outputs asks for
  std::span<const SceneObject> objects;  ///< of outputs.objects
};

/// Takes a finished frame (encode, write). Called once a frame, from several threads at once and in any order.
using FrameSink = std::function<void(const SensedFrame& frame)>;

struct FlightReport {
  std::int64_t frames = 0;
  double seconds = 0.0;  ///< wall clock, rendering and sink together
  double frames_per_second = 0.0;
  double mean_surface_share = 0.0;              ///< of pixels that see a surface
  double nearest_m = 0.0;                       ///< of all surfaces seen
  std::optional<ExposureState> exposure_after;  ///< where there is an automatic exposure
  std::vector<std::string>
      warnings;  ///< path through or too near a surface, frames that see none; one line each, with the frames
};

/// Renders a frame at each of `frames`' poses and hands it to `sink`; rendering and sink overlap. Frames (pixels and
/// exposures) do not depend on the number of threads. `pose_at` is asked for the moments and rows of a shutter; without
/// it, they come from a spline through `frames`. Throws InputError for options out of range or no frames; what `sink`
/// throws is passed on.
FlightReport render_flight(const scene::Scene& scene, const imaging::Camera& camera, const geometry::Trajectory& frames,
                           const PoseFunction& pose_at, const FlightOptions& options, const FrameSink& sink,
                           const Progress& progress = {});

}  // namespace tileflight::sensors
