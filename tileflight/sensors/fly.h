#pragma once

#include <cstdint>
#include <functional>
#include <limits>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "tileflight/geometry/progress.h"
#include "tileflight/geometry/trajectory.h"
#include "tileflight/scene/clearance.h"
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
  /// Which of those are rendered; none: each. An automatic exposure sees the others too.
  std::function<bool(std::size_t index)> wanted{};
  /// Of the automatic exposure, before `first_frame`: FlightReport::exposure_after of the frames before it.
  std::optional<ExposureState> exposure_before{};
  int frames_in_flight = 4;  ///< frames that may be in memory at once, rendered or being written
  double clearance_m = 0.3;  ///< a surface nearer than this to the camera is reported
};

/// What a frame tells of the flight's path.
struct FrameCheck {
  FrameView view;
  scene::Surroundings around;    ///< of the camera, by the surfaces that are there; clearance up to clearance_m only
  bool path_is_blocked = false;  ///< a surface lies on the way from this pose to the next
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
  FrameCheck check;
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
  std::vector<std::string> warnings;            ///< flight_warnings of what was rendered
};

/// What is wrong with where a flight's camera is, and at which frames.
struct FlightFault {
  std::string key;   ///< a word for programs: camera_near_surface, no_surface_in_view, camera_inside_surface,
                     ///< surfaces_seen_from_behind, path_through_surface
  std::string what;  ///< for people
  std::vector<std::size_t> frames;  ///< ascending
};

/// Path through, inside or too near a surface (FlightOptions::clearance_m), frames that see none: those faults that
/// there are. `checks`: of frame `first_frame` and those after it; nullopt: not known.
std::vector<FlightFault> flight_faults(std::span<const std::optional<FrameCheck>> checks, std::size_t first_frame,
                                       double clearance_m);
/// The same as lines, one for each run of frames.
std::vector<std::string> flight_warnings(std::span<const std::optional<FrameCheck>> checks, std::size_t first_frame,
                                         double clearance_m);

/// Renders a frame at each of `frames`' poses and hands it to `sink`; rendering and sink overlap. Frames (pixels and
/// exposures) do not depend on the number of threads. `pose_at` is asked for the moments and rows of a shutter; without
/// it, they come from a spline through `frames`. Throws InputError for options out of range or no frames; what `sink`
/// throws is passed on.
FlightReport render_flight(const scene::Scene& scene, const imaging::Camera& camera, const geometry::Trajectory& frames,
                           const PoseFunction& pose_at, const FlightOptions& options, const FrameSink& sink,
                           const Progress& progress = {});

}  // namespace tileflight::sensors
