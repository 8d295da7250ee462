#pragma once

#include <filesystem>
#include <optional>
#include <vector>

#include "tileflight/capture/flight_path/path.h"
#include "tileflight/capture/flight_path/smooth_path.h"
#include "tileflight/capture/missions/mission_path.h"
#include "tileflight/capture/vehicle/autopilot_plan.h"
#include "tileflight/capture/vehicle/vehicle_plan.h"
#include "tileflight/core/geometry/trajectory.h"

namespace tileflight::vehicle {

/// A mission file of another program, to be flown at a place (place_mission).
struct MissionPlan {
  std::filesystem::path file;
  missions::Mission mission;
  missions::MissionOptions options;
};

/// Contents of a FLIGHT file. Paths in it are relative to the file and are resolved here.
struct FlightPlan {
  std::filesystem::path camera;                ///< Kalibr camchain or DSO camera.txt; empty if there are `cameras`
  std::vector<std::filesystem::path> cameras;  ///< key `cameras`: the calibration files of a rig
  std::optional<geometry::Trajectory> poses;   ///< the file's poses (TUM), if the plan names one
  std::optional<flight_path::SmoothingOptions>
      smoothing;                                 ///< key `smooth`: of the path along `poses`; none: interpolates them
  std::vector<flight_path::Waypoint> waypoints;  ///< used if there are no poses
  std::optional<MissionPlan> mission_file;  ///< key `mission_file`: becomes the waypoints at a place (place_mission)
  std::optional<VehiclePlan> vehicle;       ///< key `vehicle`; without it the camera itself follows the path
  std::vector<MissionStep> mission;         ///< key `mission`: used if there is neither; needs a vehicle
  std::optional<AutopilotPlan> autopilot;   ///< key `autopilot`: in place of all these
  flight_path::SpeedLimits limits;
  std::filesystem::path sensors_file;  ///< for sensors::read_sensor_suite; empty: none
  std::optional<double> fps;           ///< without it: one frame at each pose of the file
  std::optional<int> max_frames;
  std::vector<std::string> notes{};  ///< what was assumed; a sentence each
};

/// Image rate of a mission file that is given in place of a FLIGHT file.
inline constexpr double kMissionFps = 5.0;

/// Reads FLIGHT.yaml, or a mission file (missions::is_mission_file) as a FLIGHT.yaml that names only it, of kMissionFps
/// and without a camera. Unknown keys are errors that name the nearest known key. The keys `sensors`, `sensors_file`,
/// `actors` and `weather` are accepted and left to sensors::read_sensor_suite, scene::read_actors and
/// render::read_weather. Of `cameras`, only the files' names are read; recording::read_flight_cameras() reads the rest.
/// Throws InputError.
FlightPlan read_flight_plan(const std::filesystem::path& file);

/// Lists FLIGHT.yaml itself and the files that it names (camera, cameras, trajectory, sensors_file), whether they exist
/// or not. Throws InputError if the file cannot be read.
std::vector<std::filesystem::path> referenced_files(const std::filesystem::path& file);

/// Turns the plan's mission file, if it has one, into its waypoints above a place, and adds to the plan's notes. Its
/// speeds become those of the waypoints; SpeedLimits::speed_m_s holds where the mission states none. Throws InputError
/// as missions::place_mission().
void place_mission(FlightPlan& plan, const missions::MissionPlace& place);

/// Builds the path of the plan: along its poses, through its waypoints, or as its vehicle flies waypoints or mission
/// without obstacles (vehicle_flight.h flies them among obstacles). Throws InputError for an autopilot's flight, whose
/// path is known only after it, and for a mission file that was not placed.
flight_path::Path build_path(const FlightPlan& plan);

/// Returns the poses at which frames are taken: the file's own poses (evaluated on the smoothed path, if it is
/// smoothed), or the path sampled at `fps` from its start. Times start at the file's first time, or at 0 for waypoints.
/// Waypoint paths are smooth (twice differentiable positions, continuous angular rate) and keep the limits.
geometry::Trajectory frame_poses(const FlightPlan& plan);

/// Samples the path at the plan's `fps` from its start, at most `max_frames` poses. Throws InputError for more than ten
/// million.
geometry::Trajectory sample_frames(const flight_path::Path& path, const FlightPlan& plan);

}  // namespace tileflight::vehicle
