#pragma once

#include <cstddef>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "tileflight/experiment/mission.h"
#include "tileflight/scene/scene.h"

namespace tileflight::experiment {

/// When a flight is warned of.
struct FlightCheckOptions {
  double near_m = 2.0;               ///< a surface nearer than this, in any direction
  double reach_m = 100.0;            ///< clearances are looked for up to here
  double least_surface_share = 0.2;  ///< of a view's rays: fewer that meet a surface show hardly any of the place
  double most_flow_share = 0.10;     ///< of the picture's width, from a frame to the next
  double least_start_parallax_rad = 0.026;  ///< what odometry waits for (odometry::StartOptions)
  std::size_t start_frames = 90;            ///< and how many frames it waits
  int grid = 40;                            ///< rays along the longer side of a picture
  std::size_t most_views = 3000;            ///< so many frames' views are looked at, evenly over the flight
};

/// What a frame's view, ray by ray on a grid, meets.
struct ViewCheck {
  double surface_share = std::numeric_limits<double>::quiet_NaN();  ///< NaN: not looked at
  double flow_share = std::numeric_limits<double>::quiet_NaN();  ///< median way of a surface point to the next frame,
                                                                 ///< of the width; infinite: most leave the picture;
                                                                 ///< NaN: no surface, or the last frame
};

/// Whether odometry can begin: the largest median angle, among the first frames, between the rays to what the first one
/// sees; as many degrees as the later frame still sees enough of it.
struct StartCheck {
  double parallax_rad = 0.0;
  std::size_t at_frame = 0;
};

/// A flight against the surfaces around it, a value a frame.
struct FlightCheck {
  std::vector<sensors::FrameCheck> frames;  ///< clearance up to reach_m; view and way by the grid's rays
  std::vector<ViewCheck> views;
  std::optional<StartCheck> start;  ///< nullopt: one frame, or it sees nothing
};

FlightCheck check_flight(const scene::Scene& scene, const Mission& mission, const FlightCheckOptions& options,
                         const Progress& progress);

/// What is wrong, by sensors::flight_faults and then: `view_nearly_empty`, `nothing_below`, `too_fast`.
std::vector<sensors::FlightFault> faults_of(const FlightCheck& check, const FlightCheckOptions& options);
/// The line on a start with too little parallax; nullopt where there is enough.
std::optional<std::string> start_warning(const FlightCheck& check, const FlightCheckOptions& options);

/// The outline on the ground of what a view sees within `reach_m` (horizontally): where the rays of the picture's
/// border meet a surface; where one does not, the outermost point towards the picture's middle that does. Empty: it
/// sees no surface so near.
std::vector<geometry::Vec2> footprint(const scene::Scene& scene, const imaging::Camera& camera,
                                      const geometry::SE3& T_local_camera, double reach_m);

}  // namespace tileflight::experiment
