#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "tileflight/capture/flight_path/path.h"
#include "tileflight/capture/vehicle/flight_plan.h"
#include "tileflight/capture/vehicle/vehicle_plan.h"

namespace tileflight::vehicle {

/// Distance of the camera from the planned path.
struct TrackingError {
  double rms_m = 0.0;  ///< over the flight, against the plan at the same time
  double max_m = 0.0;
  std::vector<double> nearest_to_waypoints_m;  ///< closest approach to each waypoint
};

/// Result of one command of a mission.
struct MissionResult {
  std::string name;
  Outcome outcome = Outcome::kRunning;
  double started_s = 0.0, ended_s = 0.0;  ///< on the path's clock
};

/// A vehicle's simulated flight of a plan.
struct VehicleFlight {
  flight_path::Path path;  ///< of the camera, from 0 s; interpolates its poses at every third simulation step
  Outcome outcome = Outcome::kFinished;   ///< the first that was not "finished"; if a collision ended the flight, that
  std::optional<TrackingError> tracking;  ///< only for flights through waypoints
  std::vector<MissionResult> mission;     ///< only for missions, up to the last command flown
  std::int64_t collisions = 0;
  std::optional<Collision> last_collision;  ///< on the path's clock
};

/// Receives the path's time before the obstacles are queried, so that those that move can be placed: 0 before the
/// flight, then the time of each step.
using FlightClock = std::function<void(double time_s)>;

/// Computes the camera's pose on a vehicle without a plan for it: with its mount's pitch, and the body's attitude or,
/// with a gimbal, its yaw. `T_local_body`: x forward, y left, z up, at the centre of mass.
geometry::SE3 mounted_camera_pose(const geometry::SE3& T_local_body, const CameraMount& mount);

/// Flies along a planned camera path (path_through_waypoints): its position, velocity and acceleration are the
/// reference at each time, and the vehicle's yaw is the camera's. The vehicle hovers at the start until wind and
/// controller have settled; this is not part of the flight. A collision that stops it ends the flight. Throws
/// InputError if it touches an obstacle at the start, or if a gimbal camera is rolled by more than 60 degrees.
VehicleFlight fly_along(const flight_path::Path& planned, const std::vector<flight_path::Waypoint>& waypoints,
                        const flight_path::SpeedLimits& limits, const VehiclePlan& vehicle,
                        const ObstacleQuery& obstacles = {}, const FlightClock& clock = {});

/// Flies a mission, one command after the other: commands that time out are abandoned, and a collision that stops the
/// vehicle ends the mission. Throws InputError for an empty mission.
VehicleFlight fly_mission(const std::vector<MissionStep>& mission, const VehiclePlan& vehicle,
                          const ObstacleQuery& obstacles = {}, const FlightClock& clock = {});

/// Flies the plan's waypoints or mission; the plan must have a vehicle.
VehicleFlight fly(const FlightPlan& plan, const ObstacleQuery& obstacles = {}, const FlightClock& clock = {});

}  // namespace tileflight::vehicle
