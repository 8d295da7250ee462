#include "tileflight/survey/planned_flight.h"

#include <cmath>

#include "tileflight/flight/path.h"
#include "tileflight/survey/flown_path.h"
#include "tileflight/vehicle/flight_plan.h"

namespace tileflight::survey {

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
  if (flight.degrade) mission.options.formation = *flight.degrade;
  mission.options.formation.seed = settings.seed;
  mission.calibration.line_delay_s = mission.options.formation.line_delay_s;
  return mission;
}

std::vector<tiles::ViewCone> flight_view_cones(const PlannedFlight& mission) {
  const render::ImageFormation& formation = mission.options.formation;
  const double open_s = formation.exposure_time_s * render::max_exposure_gain(formation) +
                        std::abs(formation.line_delay_s) * mission.calibration.camera.height();
  std::vector<geometry::SE3> poses;
  for (const geometry::StampedPose& pose : mission.frames.poses) {
    poses.push_back(pose.T_local_camera);
    if (open_s > 0.0) {
      for (const double time_s : {pose.time_s - open_s, pose.time_s + open_s}) poses.push_back(mission.pose_at(time_s));
    }
  }
  std::vector<tiles::ViewCone> cones = tiles::view_cones_along(mission.calibration.camera, poses);
  const bool needs_all = mission.sensor_recorder->suite().needs_scene() || formation.light;  // shadow casters
  return needs_all ? tiles::widen_to_all_directions(std::move(cones)) : cones;
}

FrameGroups group_flight_frames(const PlannedFlight& mission, const RenderSettings& settings) {
  std::vector<geometry::Vec3> positions;
  for (const geometry::StampedPose& pose : mission.frames.poses) positions.push_back(pose.T_local_camera.translation);
  return settings.error_px ? group_frames(positions) : single_group(positions);
}

}  // namespace tileflight::survey
