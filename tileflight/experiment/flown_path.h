#pragma once

#include <nlohmann/json.hpp>

#include "tileflight/experiment/fly.h"
#include "tileflight/flight/flight_plan.h"
#include "tileflight/flight/path.h"
#include "tileflight/imaging/camera.h"

namespace tileflight::experiment {

/// The way that a camera takes on a flight.
struct FlownPath {
  flight::Path path;
  geometry::Trajectory frames;  ///< a pose for each picture
  nlohmann::json vehicle;       ///< what vehicle.json says (docs/vehicles.md); null where no vehicle flies
};

/// The plan's own path, or the one that its vehicle flies. Where collisions count, the tiles around that path (as the
/// plan has it without obstacles), or of the settings' region, are read first and stand in the vehicle's way. Throws
/// InputError, also when a flight ends before its first picture.
FlownPath fly_plan(const flight::FlightPlan& plan, const RenderSettings& settings, const imaging::Camera& camera,
                   const Progress& progress);

}  // namespace tileflight::experiment
