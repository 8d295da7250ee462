#pragma once

#include <cstdint>
#include <functional>
#include <limits>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "tileflight/capture/render/appearance.h"
#include "tileflight/capture/render/auto_exposure.h"
#include "tileflight/capture/render/camera_renderer.h"
#include "tileflight/capture/render/frame_outputs.h"
#include "tileflight/capture/render/image_formation.h"
#include "tileflight/core/base/progress.h"
#include "tileflight/core/geometry/trajectory.h"
#include "tileflight/world/scene/clearance.h"

namespace tileflight::render {

/// Things that move beside the place: their parts, with poses at even steps from one time to another, seconds on the
/// clock of the frames (one pose if the times are equal). Always the same parts, names and order. Called from several
/// threads.
using PlacedParts = std::function<std::vector<scene::PlacedPart>(double from_s, double to_s)>;

/// Checks of the flight path at one frame.
struct FrameCheck {
  ViewStatistics view;
  scene::Surroundings surroundings;  ///< around the camera; clearance is measured up to clearance_m only
  bool path_is_blocked = false;      ///< a surface lies between this pose and the next
};

/// Options of render_flight().
struct FlightRenderOptions {
  RenderOptions render;
  ImageFormation formation;
  OutputChannels outputs;
  /// Moving things, shown in frames and their outputs. The automatic exposure and the checks of the path ignore them.
  PlacedParts placed{};
  std::optional<geometry::Geodetic> origin{};  ///< of the local frame; required by ImageFormation::light
  /// Appearance of the scene without placed parts, if it is shared with other cameras; null: made here.
  std::shared_ptr<const Appearance> appearance{};
  RegionPredicate scored_region;  ///< for OutputChannels::visibility; empty: everything counts
  /// Range of frames to render: from `first_frame` up to, not including, `end_frame`. They keep their numbers, and are
  /// identical to those of the whole flight.
  std::size_t first_frame = 0;
  std::size_t end_frame = std::numeric_limits<std::size_t>::max();
  /// Selects frames of the range; empty: all. The automatic exposure also meters the others.
  std::function<bool(std::size_t index)> frame_filter{};
  /// State of the automatic exposure before `first_frame`: FlightRenderReport::exposure_after of the preceding frames.
  std::optional<AutoExposureState> exposure_before{};
  /// Gains of the automatic exposure for all frames of the flight (exposure_gains), if known: nothing is metered.
  std::vector<double> exposure_gains{};
  int max_frames_in_memory = 4;  ///< frames in memory at once, being rendered or written
  double clearance_m = 0.3;      ///< surfaces nearer to the camera than this are reported
  /// Surfaces farther away do not count for Surroundings::inside.
  double inside_reach_m = 1e9;
};

/// A finished frame.
struct FlightFrame {
  std::size_t index = 0;
  double time_s = 0.0;
  double exposure_ms = 0.0;  ///< exposure time; 0 if the formation has none
  imaging::RgbImage rgb;
  imaging::FloatImage depth_m;           ///< empty if depth is not requested
  OutputImages outputs;                  ///< as requested in FlightRenderOptions::outputs
  std::span<const SceneObject> objects;  ///< of outputs.objects
  FrameCheck check;
};

/// Consumes a finished frame (encode, write). Called once per frame, from several threads at once and in any order.
using FrameSink = std::function<void(const FlightFrame& frame)>;

/// Result of render_flight().
struct FlightRenderReport {
  std::int64_t frames = 0;
  double seconds = 0.0;  ///< wall-clock time of rendering and sink together
  double frames_per_second = 0.0;
  double mean_surface_share = 0.0;                  ///< fraction of pixels that see a surface
  double nearest_m = 0.0;                           ///< nearest of all visible surfaces
  std::optional<AutoExposureState> exposure_after;  ///< set if there is an automatic exposure
  std::vector<std::string> warnings;                ///< flight_warnings of the rendered frames
};

/// A fault of a flight's camera path, and the affected frames.
struct FlightFault {
  std::string key;                  ///< identifier: camera_near_surface, no_surface_in_view, camera_inside_surface,
                                    ///< surfaces_seen_from_behind, path_through_surface
  std::string what;                 ///< human-readable description
  std::vector<std::size_t> frames;  ///< ascending
};

/// Finds faults: the path goes through, is inside or is too near a surface (FlightRenderOptions::clearance_m), or
/// frames see none. `checks`: of frame `first_frame` and those after it; nullopt: not known.
std::vector<FlightFault> find_flight_faults(std::span<const std::optional<FrameCheck>> checks, std::size_t first_frame,
                                            double clearance_m);
/// Describes the faults of find_flight_faults(), one line for each run of consecutive frames.
std::vector<std::string> flight_warnings(std::span<const std::optional<FrameCheck>> checks, std::size_t first_frame,
                                         double clearance_m);
/// Describes faults, one line for each run of consecutive frames.
std::vector<std::string> fault_warnings(const std::vector<FlightFault>& faults);

/// Renders a frame at each pose of `frames` and passes it to `sink`; rendering and sink run concurrently. Frames
/// (pixels and exposures) do not depend on the number of threads. `pose_at` gives the poses at the moments and rows of
/// a shutter; if it is empty, they come from a spline through `frames`. Throws InputError for options out of range or
/// no frames; exceptions of `sink` are passed on.
FlightRenderReport render_flight(const scene::Scene& scene, const imaging::Camera& camera,
                                 const geometry::Trajectory& frames, const PoseFunction& pose_at,
                                 const FlightRenderOptions& options, const FrameSink& sink,
                                 const Progress& progress = {});

/// Computes the mean light of each frame of the range, as the automatic exposure meters it (meter_light()).
std::vector<double> meter_flight(const scene::Scene& scene, const imaging::Camera& camera,
                                 const geometry::Trajectory& frames, const FlightRenderOptions& options);

}  // namespace tileflight::render
