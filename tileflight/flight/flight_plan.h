#pragma once

#include <filesystem>
#include <optional>
#include <vector>

#include "tileflight/flight/smoothing.h"
#include "tileflight/flight/vehicle_plan.h"
#include "tileflight/geometry/trajectory.h"

namespace tileflight::flight {

/// A continuous, twice differentiable path that can be asked at any time in [start_s, end_s].
class Path;  // path.h

/// A waypoint of a mission, in the local frame.
struct Waypoint {
  geometry::Vec3 position;                ///< camera position, metres, east north up
  std::optional<geometry::Vec3> look_at;  ///< a point to look at; else yaw and pitch
  double yaw_deg = 0.0;                   ///< heading clockwise from north
  double pitch_deg = 0.0;                 ///< of the optical axis, positive up; -90 is straight down
  double roll_deg = 0.0;
};

struct SpeedLimits {
  double speed_m_s = 8.0;
  double acceleration_m_s2 = 4.0;
  double yaw_rate_deg_s = 60.0;
};

/// FLIGHT file of the contract. Paths in it are relative to the file and already resolved here.
struct FlightPlan {
  std::filesystem::path camera;               ///< Kalibr camchain or DSO camera.txt
  std::optional<geometry::Trajectory> poses;  ///< as in the file (TUM), when the plan names one
  std::optional<SmoothingOptions> smoothing;  ///< smooth: of the path along these; none: through every one of them
  std::vector<Waypoint> waypoints;            ///< else these
  std::optional<VehiclePlan> vehicle;         ///< vehicle: flies these, or the mission; none: the camera is on the path
  std::vector<MissionStep> mission;           ///< mission: else these, by a vehicle
  SpeedLimits limits;
  std::filesystem::path sensors_file;  ///< sensors::read_sensor_suite; empty: none
  std::optional<double> fps;           ///< without: one frame at each pose of the file
  std::optional<int> max_frames;
};

/// Reads FLIGHT.yaml; unknown keys are errors that name the nearest known key. `sensors` and `sensors_file` may stand
/// there and are left to sensors::read_sensor_suite. Throws InputError.
FlightPlan read_flight_plan(const std::filesystem::path& file);

/// FLIGHT.yaml itself and the files that it names (camera, trajectory, sensors_file), whether they are there or not.
/// Throws InputError where the file cannot be read.
std::vector<std::filesystem::path> files_of_flight(const std::filesystem::path& file);

/// The path that the plan flies: along its poses, through its waypoints, or what its vehicle makes of waypoints or
/// mission where nothing is in its way (vehicle_flight.h flies it among obstacles).
Path path_of(const FlightPlan& plan);

/// The poses at which frames are taken: the file's own (as the path has them, where it is smoothed), or the path
/// sampled at `fps` from its start. Times start at the file's (or 0 for waypoints). Waypoint paths are smooth
/// (positions twice differentiable, orientation continuous in rate) and keep the limits.
geometry::Trajectory frame_poses(const FlightPlan& plan);

/// Poses on a path of the plan's at its `fps`, from the path's start, at most `max_frames`. Throws InputError for more
/// than ten million.
geometry::Trajectory frames_along(const Path& path, const FlightPlan& plan);

}  // namespace tileflight::flight
