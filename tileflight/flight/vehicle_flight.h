#pragma once

#include <optional>
#include <string>
#include <vector>

#include "tileflight/flight/flight_plan.h"
#include "tileflight/flight/path.h"
#include "tileflight/flight/vehicle_plan.h"

namespace tileflight::flight {

/// How far the camera was from where the plan has it.
struct TrackingError {
  double rms_m = 0.0;  ///< over the flight, each step at its own time
  double max_m = 0.0;
  std::vector<double> waypoints_m;  ///< nearest approach to each waypoint
};

/// How one command of a mission ended.
struct MissionResult {
  std::string name;
  Outcome outcome = Outcome::kRunning;
  double started_s = 0.0, ended_s = 0.0;  ///< on the path's clock
};

/// What a vehicle made of a plan.
struct VehicleFlight {
  Path path;  ///< of the camera, from 0 s; through its poses every third step of the simulation
  Outcome outcome = Outcome::kFinished;   ///< the first that was not "finished", of a collision the last
  std::optional<TrackingError> tracking;  ///< of a flight through waypoints
  std::vector<MissionResult> mission;     ///< of a mission, as far as it came
  std::int64_t collisions = 0;
  std::optional<Collision> last_collision;  ///< on the path's clock
};

/// Flies along a planned path of the camera (path_through_waypoints): position, velocity and acceleration are the
/// reference at each time, the craft's yaw that of the camera. It hovers at the start until wind and controller are
/// settled; that is not part of the flight. A collision that stops it ends the flight there. Throws InputError where it
/// touches something at the start, or a camera on a gimbal is rolled over 60 degrees.
VehicleFlight fly_along(const Path& planned, const std::vector<Waypoint>& waypoints, const SpeedLimits& limits,
                        const VehiclePlan& vehicle, const Obstacles& obstacles = {});

/// Flies a mission, one command after the other: those that time out are given up, a collision that stops the craft
/// ends it. Throws InputError for an empty one.
VehicleFlight fly_mission(const std::vector<MissionStep>& mission, const VehiclePlan& vehicle,
                          const Obstacles& obstacles = {});

/// Whichever of the two the plan, which has a vehicle, is.
VehicleFlight fly(const FlightPlan& plan, const Obstacles& obstacles = {});

}  // namespace tileflight::flight
