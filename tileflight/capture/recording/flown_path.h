#pragma once

#include <memory>
#include <nlohmann/json.hpp>
#include <vector>

#include "tileflight/world/scene/traffic.h"
#include "tileflight/capture/flight_path/path.h"
#include "tileflight/core/imaging/camera.h"
#include "tileflight/world/scene/scene.h"
#include "tileflight/capture/recording/render_stage.h"
#include "tileflight/capture/vehicle/flight_plan.h"

namespace tileflight::recording {

/// A camera's path on a flight.
struct FlownPath {
  flight_path::Path path;
  geometry::Trajectory frames;  ///< a pose for each image
  nlohmann::json vehicle;       ///< content of vehicle.json (docs/vehicles.md); null without a vehicle
  std::shared_ptr<const scene::Traffic> traffic;  ///< among which the vehicle flew; null: it met none
};

/// The surface around these points for collisions: the tiles that a camera there needs in all directions, if the
/// settings have a pixel error, else their region; without textures. Null if there is no triangle. Throws InputError.
std::shared_ptr<const scene::Scene> load_surroundings(const RenderSettings& settings, const imaging::Camera& camera,
                                                      const std::vector<geometry::SE3>& poses,
                                                      const Progress& progress);

/// The actors of the settings' flight on the ground that a camera at `poses` sees, its heights about that of the first
/// pose unless given; null without any. Of the tiles that load_surroundings() would load, only those below the actors
/// are read, within the settings' memory. Throws InputError.
std::shared_ptr<const scene::Traffic> plan_traffic(const RenderSettings& settings, const imaging::Camera& camera,
                                                    std::vector<geometry::SE3> poses, const Progress& progress);

/// The plan's own path, or the one that its vehicle flies. If collisions are enabled, the tiles around that path (as
/// planned without obstacles), or of the settings' region, are loaded first and used as obstacles, and actors are
/// obstacles where they are at each time of the path. Throws InputError, also if a flight ends before its first image.
FlownPath fly_plan(const vehicle::FlightPlan& plan, const RenderSettings& settings, const imaging::Camera& camera,
                   const Progress& progress);

}  // namespace tileflight::recording
