#include "tileflight/survey/planned_flight.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "tileflight/flight/path.h"
#include "tileflight/survey/flown_path.h"
#include "tileflight/vehicle/flight_plan.h"

namespace tileflight::survey {
namespace {

/// Poses of the camera at a frame, and if its shutter is open for some time, before and after it.
std::vector<geometry::SE3> exposure_poses(const PlannedFlight& mission, std::size_t frame) {
  const render::ImageFormation& formation = mission.options.formation;
  const double open_s = formation.exposure_time_s * render::max_exposure_gain(formation) +
                        std::abs(formation.line_delay_s) * mission.calibration.camera.height();
  const geometry::StampedPose& pose = mission.frames.poses[frame];
  std::vector<geometry::SE3> poses{pose.T_local_camera};
  if (open_s == 0.0) return poses;
  for (const double time_s : {pose.time_s - open_s, pose.time_s + open_s}) poses.push_back(mission.pose_at(time_s));
  return poses;
}

}  // namespace

PlannedFlight plan_flight(const RenderSettings& settings, const Progress& progress) {
  const RenderedFlightConfig& flight = settings.flight;
  const vehicle::FlightPlan plan = vehicle::read_flight_plan(flight.flight);
  PlannedFlight mission;
  mission.calibration = imaging::read_calibration(flight.camera.empty() ? plan.camera : flight.camera);
  if (flight.width) mission.calibration.camera = mission.calibration.camera.scaled_to(*flight.width, *flight.height);
  FlownPath flown = fly_plan(plan, settings, mission.calibration.camera, progress);
  mission.frames = std::move(flown.frames);
  mission.vehicle = std::move(flown.vehicle);
  if (flight.max_frames && mission.frames.size() > static_cast<std::size_t>(*flight.max_frames)) {
    mission.frames.poses.resize(static_cast<std::size_t>(*flight.max_frames));
  }
  const flight::Path path = flown.path;
  mission.pose_at = [path](double time_s) { return path.pose(time_s); };
  mission.sensor_recorder = std::make_shared<SensorRecorder>(
      sensors::read_sensor_suite(flight.flight, settings.seed, mission.calibration.T_cam_imu), path, mission.frames);
  mission.options.render = {.depth = flight.outputs.depth, .samples_per_pixel = flight.samples_per_pixel};
  mission.options.outputs = flight.outputs.to_frame_outputs();
  std::vector<geometry::SE3> flown_poses;
  for (const geometry::StampedPose& pose : mission.frames.poses) flown_poses.push_back(pose.T_local_camera);
  mission.traffic =
      flown.traffic ? flown.traffic : plan_traffic(settings, mission.calibration.camera, flown_poses, progress);
  if (mission.traffic) {
    mission.options.placed = [traffic = mission.traffic](double from_s, double to_s) {
      return traffic->placed(from_s, to_s);
    };
    mission.options.outputs.placed_objects = true;  // for the boxes of what is visible
    mission.sensor_recorder->set_placed(mission.options.placed);
  }
  if (flight.degrade) mission.options.formation = *flight.degrade;
  mission.options.formation.seed = settings.seed;
  mission.calibration.line_delay_s = mission.options.formation.line_delay_s;
  return mission;
}

std::vector<tiles::ViewCone> flight_view_cones(const PlannedFlight& mission) {
  std::vector<geometry::SE3> poses;
  for (std::size_t frame = 0; frame < mission.frames.size(); ++frame) {
    const std::vector<geometry::SE3> of_frame = exposure_poses(mission, frame);
    poses.insert(poses.end(), of_frame.begin(), of_frame.end());
  }
  std::vector<tiles::ViewCone> cones = tiles::view_cones_along(mission.calibration.camera, poses);
  return may_divide_images(mission) ? cones : tiles::widen_to_all_directions(std::move(cones));
}

std::vector<tiles::ViewCone> region_view_cones(const PlannedFlight& mission, std::size_t frame,
                                               const std::vector<tiles::ViewCone>& cones) {
  const std::vector<geometry::SE3> poses = exposure_poses(mission, frame);
  double turn_rad = 0.0;  // during the exposure
  for (const geometry::SE3& pose : poses)
    turn_rad = std::max(turn_rad, pose.rotation.angularDistance(poses.front().rotation));
  std::vector<tiles::ViewCone> local;
  for (const geometry::SE3& pose : poses) {
    for (const tiles::ViewCone& cone : cones) {
      local.push_back(cone);
      local.back().position = pose.translation;
      local.back().axis = pose.rotation * cone.axis;
      local.back().half_angle_rad = std::min(std::numbers::pi, cone.half_angle_rad + turn_rad);
    }
  }
  return local;
}

bool may_divide_images(const PlannedFlight& mission) {
  return !mission.sensor_recorder->suite().needs_scene() && !mission.options.formation.light;
}

FrameGroups group_flight_frames(const PlannedFlight& mission, const RenderSettings& settings) {
  std::vector<geometry::Vec3> positions;
  for (const geometry::StampedPose& pose : mission.frames.poses) positions.push_back(pose.T_local_camera.translation);
  return settings.error_px ? group_frames(positions) : single_group(positions);
}

}  // namespace tileflight::survey
