#include "tileflight/capture/vehicle/flight_plan.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "tileflight/capture/flight_path/path.h"
#include "tileflight/capture/flight_path/smooth_path.h"
#include "tileflight/capture/vehicle/vehicle_flight.h"
#include "tileflight/core/base/formatted_text.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/strict_section.h"

namespace tileflight::vehicle {
namespace {

using base::StrictSection;

constexpr double kMaxFrames = 1e7;

std::optional<geometry::Vec3> read_vector(StrictSection& section, const std::string& key) {
  const auto numbers = section.numbers(key, 3, 3);
  if (!numbers) return std::nullopt;
  return geometry::Vec3(numbers->at(0), numbers->at(1), numbers->at(2));
}

flight_path::Waypoint read_waypoint(StrictSection section) {
  flight_path::Waypoint waypoint;
  const std::optional<geometry::Vec3> position = read_vector(section, "position");
  waypoint.look_at = read_vector(section, "look_at");
  const std::optional<double> yaw = section.number("yaw_deg"), pitch = section.number("pitch_deg");
  waypoint.roll_deg = section.number("roll_deg").value_or(0.0);
  const std::optional<double> speed = section.positive_number("speed_m_s"), hold = section.number("hold_s");
  section.require_all_keys_used();
  constexpr double kLongest_s = 3600.0;
  if (hold && !(*hold >= 0.0 && *hold <= kLongest_s)) throw section.error("hold_s", "must be from 0 to 3600 seconds");
  if (!position) throw section.error("position", "is missing; give [east, north, up] in metres");
  if (waypoint.look_at && (yaw || pitch))
    throw section.error("look_at", "and yaw_deg or pitch_deg are both given; keep one of the two");
  waypoint.position = *position;
  waypoint.yaw_deg = yaw.value_or(0.0);
  waypoint.pitch_deg = pitch.value_or(0.0);
  waypoint.speed_m_s = speed;
  waypoint.hold_s = hold;
  return waypoint;
}

std::vector<flight_path::Waypoint> read_waypoints(StrictSection& plan) {
  std::vector<flight_path::Waypoint> waypoints;
  for (const StrictSection& waypoint : plan.sections("waypoints")) waypoints.push_back(read_waypoint(waypoint));
  return waypoints;
}

/// `mission_file: FILE`, or a map with the key `file` and what the file leaves open.
std::optional<MissionPlan> read_mission_file(StrictSection& plan) {
  if (!plan.is_map("mission_file")) {
    const auto file = plan.path("mission_file");
    if (!file) return std::nullopt;
    return MissionPlan{*file, missions::read_mission(*file), {}};
  }
  StrictSection section = plan.section("mission_file").value();
  const auto file = section.path("file");
  if (!file) throw section.error("file", "is missing; name the mission file");
  const missions::MissionOptions options = missions::read_mission_options(section);
  section.require_all_keys_used();
  return MissionPlan{*file, missions::read_mission(*file), options};
}

/// A mission in place of a flight file.
FlightPlan plan_of_mission(const std::filesystem::path& file) {
  FlightPlan plan;
  plan.mission_file = MissionPlan{file, missions::read_mission(file), {}};
  plan.fps = kMissionFps;
  plan.notes.push_back(
      base::formatted("the mission is flown without a flight file: %g images a second, turning at most "
                      "%g degrees a second",
                      kMissionFps, plan.limits.yaw_rate_deg_s));
  return plan;
}

std::optional<int> read_max_frames(StrictSection& plan) {
  const std::optional<double> value = plan.positive_number("max_frames");
  if (!value) return std::nullopt;
  if (*value != std::floor(*value) || *value > kMaxFrames)
    throw plan.error("max_frames", "must be a whole number up to ten million");
  return static_cast<int>(*value);
}

flight_path::SpeedLimits read_limits(StrictSection& plan) {
  flight_path::SpeedLimits limits;
  limits.speed_m_s = plan.positive_number("speed_m_s").value_or(limits.speed_m_s);
  limits.acceleration_m_s2 = plan.positive_number("acceleration_m_s2").value_or(limits.acceleration_m_s2);
  limits.yaw_rate_deg_s = plan.positive_number("yaw_rate_deg_s").value_or(limits.yaw_rate_deg_s);
  return limits;
}

/// `cameras: camchain.yaml`, or a list of cameras that each name a file.
std::vector<std::filesystem::path> read_camera_files(StrictSection& plan) {
  if (!plan.is_list("cameras")) {
    const auto chain = plan.path("cameras");
    return chain ? std::vector{*chain} : std::vector<std::filesystem::path>{};
  }
  std::vector<std::filesystem::path> files;
  for (StrictSection& camera : plan.sections("cameras")) files.push_back(camera.path("camera").value_or(""));
  if (files.empty()) throw plan.error("cameras", "lists no camera; give at least one");
  return files;
}

/// Only waypoints and missions can be flown by a vehicle, and a mission requires one.
void check_vehicle(const StrictSection& section, const FlightPlan& plan) {
  if (plan.vehicle && plan.poses)
    throw section.error("vehicle", "and 'trajectory' are both given; a vehicle flies waypoints or a mission");
  if (plan.mission.empty()) return;
  if (!plan.vehicle) throw section.error("mission", "is flown by a vehicle; add 'vehicle: {}'");
  if (!plan.waypoints.empty()) throw section.error("mission", "and 'waypoints' are both given; keep one of the two");
}

/// A mission file is a path of its own.
void check_mission_file(const StrictSection& section, const FlightPlan& plan) {
  if (plan.poses || !plan.waypoints.empty() || !plan.mission.empty() || plan.autopilot)
    throw section.error("mission_file", "is a path of its own; leave out trajectory, waypoints, mission and autopilot");
  if (plan.smoothing) throw section.error("smooth", "applies to a 'trajectory' only");
  if (!plan.fps) throw section.error("fps", "is missing; a mission file does not define frames");
}

/// An autopilot has a mission of its own.
void check_autopilot(const StrictSection& section, const FlightPlan& plan) {
  if (plan.vehicle || plan.poses || !plan.waypoints.empty() || !plan.mission.empty())
    throw section.error("autopilot",
                        "flies a mission of its own; leave out vehicle, trajectory, waypoints and mission");
  if (plan.smoothing) throw section.error("smooth", "applies to a 'trajectory' only");
  if (!plan.fps) throw section.error("fps", "is missing; an autopilot's flight does not define frames");
}

/// Checks that the plan states exactly one kind of path and when to take images.
void check_plan(const StrictSection& section, const FlightPlan& plan) {
  if (!plan.camera.empty() && !plan.cameras.empty())
    throw section.error("cameras", "and 'camera' are both given; keep one of the two");
  if (plan.camera.empty() && plan.cameras.empty())
    throw section.error("camera", "is missing; name the calibration file");
  if (plan.poses && !plan.waypoints.empty())
    throw section.error("waypoints", "and 'trajectory' are both given; keep one of the two");
  if (plan.mission_file) return check_mission_file(section, plan);
  if (plan.autopilot) return check_autopilot(section, plan);
  check_vehicle(section, plan);
  if (!plan.poses && plan.mission.empty() && plan.waypoints.size() < 2)
    throw section.error("waypoints", "must be at least two, or 'trajectory' must name a TUM file");
  if (!plan.poses && plan.smoothing)
    throw section.error("smooth", "applies to a 'trajectory' only; waypoints are passed exactly");
  if (!plan.poses && !plan.fps) throw section.error("fps", "is missing; waypoints do not define frames");
}

geometry::Trajectory project_onto_path(const flight_path::Path& path, geometry::Trajectory trajectory) {
  for (geometry::StampedPose& pose : trajectory.poses) pose.T_local_camera = path.pose(pose.time_s);
  return trajectory;
}

geometry::Trajectory sample_path(const flight_path::Path& path, double fps, double most_frames) {
  const double frames = std::min(most_frames, std::floor((path.end_s() - path.start_s()) * fps + 1e-9) + 1.0);
  if (frames > kMaxFrames) throw InputError("flight", "more than ten million frames; lower 'fps' or set 'max_frames'");
  geometry::Trajectory trajectory;
  for (std::size_t i = 0; i < static_cast<std::size_t>(frames); ++i) {
    const double time_s = path.start_s() + static_cast<double>(i) / fps;
    trajectory.poses.push_back({time_s, path.pose(time_s)});
  }
  return trajectory;
}

}  // namespace

FlightPlan read_flight_plan(const std::filesystem::path& file) {
  if (missions::is_mission_file(file)) return plan_of_mission(file);
  StrictSection section = StrictSection::load(file);
  FlightPlan plan;
  plan.camera = section.path("camera").value_or("");
  plan.cameras = read_camera_files(section);
  const auto trajectory = section.path("trajectory");
  plan.smoothing = flight_path::read_smoothing(section, std::nullopt);
  plan.waypoints = read_waypoints(section);
  plan.mission_file = read_mission_file(section);
  if (auto vehicle = section.section("vehicle")) plan.vehicle = read_vehicle(*vehicle);
  plan.mission = read_mission(section);
  if (auto autopilot = section.section("autopilot")) plan.autopilot = read_autopilot_plan(*autopilot, file);
  plan.limits = read_limits(section);
  plan.fps = section.positive_number("fps");
  plan.max_frames = read_max_frames(section);
  section.section("sensors");  // accepted here, but read by sensors::read_sensor_suite
  section.sections("actors");  // likewise, by scene::read_actors
  section.section("weather");  // likewise, by render::read_weather
  section.section("events");   // likewise, by recording::read_flight_cameras
  plan.sensors_file = section.path("sensors_file").value_or("");
  section.require_all_keys_used();
  if (trajectory) plan.poses = geometry::read_tum(*trajectory);
  check_plan(section, plan);
  return plan;
}

std::vector<std::filesystem::path> referenced_files(const std::filesystem::path& file) {
  if (missions::is_mission_file(file)) return {file};
  StrictSection section = StrictSection::load(file);
  std::vector<std::filesystem::path> files{file};
  for (const char* key : {"camera", "trajectory", "sensors_file"}) {
    if (const auto named = section.path(key)) files.push_back(*named);
  }
  for (const std::filesystem::path& camera : read_camera_files(section)) files.push_back(camera);
  if (section.is_map("mission_file")) {
    StrictSection mission = section.section("mission_file").value();
    files.push_back(mission.path("file").value_or(""));
  } else if (const auto mission = section.path("mission_file")) {
    files.push_back(*mission);
  }
  return files;
}

void place_mission(FlightPlan& plan, const missions::MissionPlace& place) {
  if (!plan.mission_file) return;
  const std::string where = plan.mission_file->file.string();
  missions::PlacedMission placed = missions::place_mission(plan.mission_file->mission, plan.mission_file->options,
                                                           place, plan.limits.speed_m_s, where);
  plan.waypoints = std::move(placed.waypoints);
  plan.notes.insert(plan.notes.end(), placed.notes.begin(), placed.notes.end());
  // The vehicle's reserve follows the fastest leg.
  plan.limits.speed_m_s = 0.0;
  for (const flight_path::Waypoint& waypoint : plan.waypoints)
    plan.limits.speed_m_s = std::max(plan.limits.speed_m_s, waypoint.speed_m_s.value_or(0.0));
}

flight_path::Path build_path(const FlightPlan& plan) {
  if (plan.autopilot)
    throw InputError("flight",
                     "an autopilot's path is known only after its flight: render it, then name the dataset's "
                     "groundtruth.txt as 'trajectory'");
  if (plan.mission_file && plan.waypoints.empty())
    throw InputError(plan.mission_file->file.string(), "is flown at a place, and none is known here");
  if (plan.vehicle) return fly(plan).path;
  if (!plan.poses) return flight_path::path_through_waypoints(plan.waypoints, plan.limits);
  return plan.smoothing ? flight_path::smooth_path(*plan.poses, *plan.smoothing).path
                        : flight_path::path_through_poses(*plan.poses);
}

geometry::Trajectory sample_frames(const flight_path::Path& path, const FlightPlan& plan) {
  if (!plan.fps) throw InputError("flight", "waypoints need 'fps'");
  return sample_path(path, *plan.fps, plan.max_frames ? *plan.max_frames : HUGE_VAL);
}

geometry::Trajectory frame_poses(const FlightPlan& plan) {
  const double most_frames = plan.max_frames ? *plan.max_frames : HUGE_VAL;
  if (!plan.fps) {
    if (!plan.poses) throw InputError("flight", "waypoints need 'fps'");
    geometry::Trajectory trajectory = *plan.poses;
    if (static_cast<double>(trajectory.size()) > most_frames)
      trajectory.poses.resize(static_cast<std::size_t>(most_frames));
    return plan.smoothing ? project_onto_path(build_path(plan), std::move(trajectory)) : trajectory;
  }
  return sample_frames(build_path(plan), plan);
}

}  // namespace tileflight::vehicle
