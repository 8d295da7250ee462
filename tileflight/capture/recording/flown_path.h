#pragma once

#include <memory>
#include <nlohmann/json.hpp>
#include <vector>

#include "tileflight/capture/flight_path/path.h"
#include "tileflight/capture/recording/render_stage.h"
#include "tileflight/capture/vehicle/flight_plan.h"
#include "tileflight/core/imaging/camera.h"
#include "tileflight/world/scene/scene.h"
#include "tileflight/world/scene/traffic.h"

namespace tileflight::recording {

/// A camera's path on a flight.
struct FlownPath {
  flight_path::Path path;
  geometry::Trajectory frames;  ///< a pose for each image
  nlohmann::json vehicle;       ///< content of vehicle.json (docs/vehicles.md); null without a vehicle
  std::shared_ptr<const scene::Traffic> traffic;  ///< among which the vehicle flew; null: it met none
};

/// Loads the surface around these points for collisions: the tiles that a camera there needs in all directions, if the
/// settings have a pixel error, else their region; without textures. Null if there is no triangle. Throws InputError.
std::shared_ptr<const scene::Scene> load_surroundings(const RenderSettings& settings, const imaging::Camera& camera,
                                                      const std::vector<geometry::SE3>& poses,
                                                      const Progress& progress);

/// Plans the traffic of the settings' flight: its actors on the ground that a camera at `poses` sees; null without any.
/// Heights that are not given are about that of the first pose. Only those of the tiles of load_surroundings() that lie
/// below the actors are read, within the settings' memory. Throws InputError.
std::shared_ptr<const scene::Traffic> plan_traffic(const RenderSettings& settings, const imaging::Camera& camera,
                                                   std::vector<geometry::SE3> poses, const Progress& progress);

/// Puts the plan's mission file, if it has one, into the place: its frame is that of a render with these settings, and
/// heights above ground and take-off are those of the finest tiles. Throws InputError, also if the place is not
/// georeferenced.
void place_mission(vehicle::FlightPlan& plan, const std::string& source, const tileset::LoadOptions& load,
                   const Progress& progress);

/// Returns the plan's own path, or the one that its vehicle flies. If collisions are enabled, the tiles around that
/// path (as planned without obstacles), or of the settings' region, are loaded first and used as obstacles, and actors
/// are obstacles where they are at each time of the path. Throws InputError, also if a flight ends before its first
/// image.
FlownPath fly_plan(const vehicle::FlightPlan& plan, const RenderSettings& settings, const imaging::Camera& camera,
                   const Progress& progress);

}  // namespace tileflight::recording
