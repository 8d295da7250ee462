#pragma once

#include <cstddef>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "tileflight/capture/recording/planned_flight.h"
#include "tileflight/world/scene/scene.h"

namespace tileflight::preview {

/// Thresholds of a flight's warnings.
struct FlightCheckOptions {
  double min_clearance_m = 2.0;                    ///< warn about surfaces nearer than this, in any direction
  double max_clearance_m = 100.0;                  ///< search limit of clearances
  double min_surface_share = 0.2;                  ///< share of a view's rays that should hit a surface
  double max_flow_share = 0.10;                    ///< of the image's width, from one frame to the next
  double min_initialization_parallax_rad = 0.026;  ///< that odometry requires
                                                   ///< (odometry::OdometryOptions::initialization)
  std::size_t initialization_frames = 90;          ///< number of frames within which it is required
  int rays_per_side = 40;                          ///< rays along the longer side of an image
  std::size_t max_views = 3000;                    ///< frames whose views are checked, evenly spread over the flight
};

/// Result of casting a grid of rays through a frame's view.
struct ViewCheck {
  double surface_share = std::numeric_limits<double>::quiet_NaN();  ///< NaN: not checked
  double flow_share = std::numeric_limits<double>::quiet_NaN();  ///< median displacement of surface points to the next
                                                                 ///< frame, relative to the width; infinite: most leave
                                                                 ///< the image; NaN: no surface, or the last frame
};

/// Parallax available for initialization of odometry: among the first frames, the largest median angle between the rays
/// from two cameras to the points that the first one sees, as long as the later frame still sees enough of them.
struct InitializationCheck {
  double parallax_rad = 0.0;
  std::size_t at_frame = 0;
};

/// A flight checked against the surfaces around it, one value per frame.
struct FlightCheck {
  std::vector<render::FrameCheck> frames;  ///< clearance up to max_clearance_m; view and path by the rays of the grid
  std::vector<ViewCheck> views;
  std::vector<render::FlightFault> of_actors;         ///< find_actor_faults()
  std::optional<InitializationCheck> initialization;  ///< nullopt: a single frame, or no visible surface
};

/// Checks clearance, views and initialization of a flight against the scene's surfaces.
FlightCheck check_flight(const scene::Scene& scene, const recording::PlannedFlight& mission,
                         const FlightCheckOptions& options, const Progress& progress);

/// Lists all faults: those of render::find_flight_faults(), those of actors, then `view_nearly_empty`, `nothing_below`,
/// `too_fast`.
std::vector<render::FlightFault> find_faults(const FlightCheck& check, const FlightCheckOptions& options);
/// Returns a warning about too little parallax at the start; nullopt if there is enough.
std::optional<std::string> initialization_warning(const FlightCheck& check, const FlightCheckOptions& options);

/// Computes the outline on the ground of the area visible within `reach_m` (horizontally): the surface points hit by
/// rays through the image border; where such a ray hits none, the outermost hit towards the image centre. Empty: no
/// surface within reach.
std::vector<geometry::Vec2> footprint(const scene::Scene& scene, const imaging::Camera& camera,
                                      const geometry::SE3& T_local_camera, double reach_m);

}  // namespace tileflight::preview
