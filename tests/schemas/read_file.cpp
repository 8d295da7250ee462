// The program's own readers, for the tests of schemas/: for each line `KIND FILE` of standard input a line `ok`, or
// what is wrong with the file. `read_file --defaults FOLDER` prints, as JSON, what the readers make of files without
// keys; FOLDER is for those files.
#include <fstream>
#include <iostream>
#include <nlohmann/json.hpp>

#include "tileflight/capture/events/event_options.h"
#include "tileflight/capture/ingest/ingest_stage.h"
#include "tileflight/capture/recording/flight_cameras.h"
#include "tileflight/capture/render/weather.h"
#include "tileflight/capture/sensors/sensor_suite.h"
#include "tileflight/capture/vehicle/flight_plan.h"
#include "tileflight/core/base/files.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/geometry/transform.h"
#include "tileflight/core/imaging/camera.h"
#include "tileflight/evaluation/metrics/metrics_file.h"
#include "tileflight/experiments/experiment/experiment_file.h"
#include "tileflight/experiments/experiment/stage_options.h"
#include "tileflight/experiments/study/study_file.h"
#include "tileflight/slam/external_systems/adapter.h"
#include "tileflight/world/scene/traffic.h"

namespace {

namespace tf = tileflight;
namespace fs = std::filesystem;
using nlohmann::json;

void read(const std::string& kind, const fs::path& file) {
  if (kind == "experiment") tf::experiment::read_experiment(file);
  if (kind == "study") tf::study::read_study(file);
  if (kind == "adapter") tf::external_systems::read_adapter(file.parent_path());
  if (kind == "camera") tf::imaging::read_calibration(file);
  if (kind == "metrics") tf::metrics::metrics_from_json(tf::base::read_json(file), file.string());
  if (kind == "degrade") {
    auto section = tf::base::StrictSection::load(file);
    tf::recording::RenderedFlightConfig flight;
    tf::experiment::read_degrade(section, flight);
  }
  if (kind == "flight" || kind == "sensors") {
    if (kind == "flight") tf::vehicle::read_flight_plan(file);
    if (kind == "flight") tf::scene::read_actors(file);
    if (kind == "flight") tf::render::read_weather(file);
    tf::recording::RenderedFlightConfig flight;
    flight.flight = file;
    if (kind == "flight") tf::recording::read_flight_cameras(flight);
    tf::sensors::read_sensor_suite(file, 1, {});
  }
}

std::string one_line(std::string text) {
  std::ranges::replace(text, '\n', ' ');
  return text;
}

int read_all() {
  for (std::string kind, file; std::cin >> kind >> file;) {
    try {
      read(kind, file);
      std::cout << "ok" << std::endl;
    } catch (const std::exception& error) {
      std::cout << one_line(error.what()) << std::endl;
    }
  }
  return 0;
}

template <class Matrix>
json numbers(const Matrix& values) {
  json list = json::array();
  for (Eigen::Index row = 0; row < values.rows(); ++row)
    for (Eigen::Index column = 0; column < values.cols(); ++column) list.push_back(values(row, column));
  return list;
}

fs::path written(const fs::path& folder, const std::string& name, const std::string& text) {
  tf::base::write_file(folder / name, text);
  return folder / name;
}

json alignment_defaults(const tf::alignment::AlignMapOptions& o) {
  return {{"radius", o.icp.radius_m},
          {"rms_change", o.icp.rms_change_m},
          {"max_iterations", o.icp.max_iterations},
          {"max_scale_change", o.icp.max_scale_change},
          {"kernel_scale", o.icp.kernel.scale_m},
          {"kept_share", o.icp.kept_share},
          {"scale_seeds", o.scale_seeds},
          {"coarse_radii", o.coarse_radii_m},
          {"find_regions", o.find_regions},
          {"estimate_time_offset", o.trajectory.estimate_time_offset},
          {"scale", o.icp.scale == tf::alignment::ScaleMode::kFixed ? "fixed" : "estimated"},
          {"method", o.use_all_evidence ? "all-evidence" : "another"},
          {"start", o.start == tf::alignment::AlignmentStart::kAuto ? "auto" : "another"},
          {"kernel", o.icp.kernel.kind == tf::alignment::KernelType::kNone ? "none" : "another"}};
}

json evaluation_defaults(const tf::scoring::EvaluationSettings& s) {
  return {{"cutoff", s.cutoff_m},
          {"thresholds", s.thresholds_m},
          {"equivalence_margin", s.equivalence_margin_m},
          {"ratio_margin", s.ratio_margin},
          {"share_margin", s.share_margin},
          {"completeness_margin", s.completeness_margin},
          {"lacking_margin", s.lacking_margin},
          {"path_margin", s.path_margin_m},
          {"completeness_samples_per_m2", s.completeness_samples_per_m2},
          {"entropy_radius", s.entropy_radius_m},
          {"wasserstein_voxel", s.wasserstein_voxel_m},
          {"wasserstein_min_points", s.wasserstein_min_points},
          {"agreement_cell", s.agreement_cell_m}};
}

json odometry_defaults(const tf::experiment::OdometryConfig& o) {
  return {{"points_per_keyframe", o.options.selection.points_per_keyframe},
          {"active_points", o.options.window.active_points},
          {"min_keyframes", o.options.window.min_keyframes},
          {"max_keyframes", o.options.window.max_keyframes},
          {"iterations", o.options.window.iterations},
          {"min_observations", o.options.map.min_observations},
          {"max_relative_deviation", o.options.map.max_relative_sigma},
          {"dense", o.options.map.dense},
          {"loop_closure", o.options.loops.enabled},
          {"fixed_intrinsics", !o.options.window.refine_intrinsics},
          {"estimate_line_delay", o.options.estimate_line_delay},
          {"seed", o.options.initialization.seed},
          {"mode", tf::odometry::to_string(o.track_options.mode)},
          {"tight", o.options.inertial_in_window},
          {"gravity", o.track_options.gravity_m_s2},
          {"colmap", o.track_options.colmap},
          {"debug_pictures", o.debug_pictures},
          {"runs", o.runs},
          {"later", o.start_offset_frames},
          {"backwards", o.backwards}};
}

json degrade_defaults(const tf::render::ImageFormation& f) {
  const tf::render::DaylightOptions light = f.light.value();
  return {{"light.turbidity", light.turbidity},
          {"light.ground_albedo", light.ground_albedo},
          {"light.exposure", light.exposure_stops},
          {"light.model", "sun-and-sky"},
          {"light.white_balance", light.white_balance == tf::render::WhiteBalance::kDaylight ? "daylight" : "ground"},
          {"haze_visibility", f.haze_visibility_m},
          {"chromatic_red", f.chromatic_red},
          {"chromatic_blue", f.chromatic_blue},
          {"exposure_time", f.exposure_time_s},
          {"exposure_samples", f.exposure_samples},
          {"line_delay", f.line_delay_s},
          {"vignetting", f.vignetting},
          {"auto_exposure.target", f.auto_exposure.target},
          {"auto_exposure.time_constant", f.auto_exposure.time_constant_s},
          {"auto_exposure.min_gain", f.auto_exposure.min_gain},
          {"auto_exposure.max_gain", f.auto_exposure.max_gain},
          {"exposure_drift", f.exposure_drift},
          {"exposure_drift_period", f.exposure_drift_period_s},
          {"exposure_steps[].time", f.exposure_steps.at(0).time_s},
          {"exposure_steps[].gain", f.exposure_steps.at(0).gain},
          {"white_electrons", f.white_electrons},
          {"read_noise_electrons", f.read_noise_electrons},
          {"gamma", f.gamma},
          {"sharpening", f.sharpening},
          {"sharpening_radius", f.sharpening_radius_px}};
}

json site_defaults(const tf::experiment::SiteConfig& place) {
  return {{"error", place.error_m}, {"texture_scale", place.texture_scale}, {"terms_accepted", place.terms_accepted}};
}

json sensor_defaults(const tf::sensors::SensorSuite& s) {
  const auto& [imu, gnss, lidar] = std::tie(*s.imu, *s.gnss, *s.lidar);
  return {{"imu.rate_hz", imu.rate_hz},
          {"imu.preset", "adis16448"},
          {"imu.accelerometer_noise_density", imu.accelerometer_noise_density},
          {"imu.accelerometer_random_walk", imu.accelerometer_random_walk},
          {"imu.gyroscope_noise_density", imu.gyroscope_noise_density},
          {"imu.gyroscope_random_walk", imu.gyroscope_random_walk},
          {"imu.accelerometer_bias", numbers(imu.accelerometer_bias)},
          {"imu.gyroscope_bias", numbers(imu.gyroscope_bias)},
          {"imu.accelerometer_scale_misalignment", numbers(imu.accelerometer_scale_misalignment)},
          {"imu.gyroscope_scale_misalignment", numbers(imu.gyroscope_scale_misalignment)},
          {"imu.accelerometer_range_m_s2", imu.accelerometer_range_m_s2},
          {"imu.gyroscope_range_rad_s", imu.gyroscope_range_rad_s},
          {"imu.gravity_m_s2", imu.gravity_m_s2},
          {"gnss.rate_hz", gnss.rate_hz},
          {"gnss.horizontal_sigma_m", gnss.horizontal_sigma_m},
          {"gnss.vertical_sigma_m", gnss.vertical_sigma_m},
          {"gnss.horizontal_bias_sigma_m", gnss.horizontal_bias_sigma_m},
          {"gnss.vertical_bias_sigma_m", gnss.vertical_bias_sigma_m},
          {"gnss.bias_time_s", gnss.bias_time_s},
          {"gnss.lag_s", gnss.lag_s},
          {"attitude.rate_hz", s.attitude->rate_hz},
          {"attitude.noise_deg", s.attitude->noise_deg},
          {"attitude.tilt_bias_sigma_deg", s.attitude->tilt_bias_sigma_deg},
          {"attitude.yaw_bias_sigma_deg", s.attitude->yaw_bias_sigma_deg},
          {"attitude.bias_time_s", s.attitude->bias_time_s},
          {"barometer.rate_hz", s.barometer->rate_hz},
          {"barometer.sea_level_pressure_pa", s.barometer->atmosphere.sea_level_pressure_pa},
          {"barometer.sea_level_temperature_k", s.barometer->atmosphere.sea_level_temperature_k},
          {"barometer.noise_pa", s.barometer->noise_pa},
          {"barometer.drift_pa", s.barometer->drift_pa},
          {"barometer.drift_time_s", s.barometer->drift_time_s},
          {"barometer.origin_above_sea_m", s.origin_above_sea_m},
          {"magnetometer.rate_hz", s.magnetometer->rate_hz},
          {"magnetometer.noise_ut", s.magnetometer->noise_ut},
          {"magnetometer.hard_iron_ut", numbers(s.magnetometer->hard_iron_ut)},
          {"magnetometer.soft_iron", numbers(s.magnetometer->soft_iron)},
          {"magnetometer.year", s.magnetic_field.year},
          {"range_finder.rate_hz", s.range_finder->rate_hz},
          {"range_finder.frame", s.range_finder->direction_is_local ? "local" : "camera"},
          {"range_finder.position", numbers(s.range_finder->position_camera)},
          {"range_finder.beam_width_deg", s.range_finder->beam_width_deg},
          {"range_finder.rays", s.range_finder->rays},
          {"range_finder.min_range_m", s.range_finder->min_range_m},
          {"range_finder.max_range_m", s.range_finder->max_range_m},
          {"range_finder.noise_m", s.range_finder->noise_m},
          {"range_finder.noise_share", s.range_finder->noise_share},
          {"lidar.rate_hz", std::get<tf::sensors::RasterPattern>(lidar.pattern).rate_hz},
          {"lidar.motion", lidar.motion == tf::sensors::ScanMotion::kDistorted ? "distorted" : "another"},
          {"lidar.min_range_m", lidar.min_range_m},
          {"lidar.max_range_m", lidar.max_range_m},
          {"lidar.range_sigma_m", lidar.range_sigma_m},
          {"lidar.range_sigma_share", lidar.range_sigma_share},
          {"lidar.divergence_rad", lidar.divergence_rad},
          {"lidar.albedo_gain", lidar.albedo_gain},
          {"lidar.intensity_falls_with_range", lidar.intensity_falls_with_range},
          {"lidar.intensity_reference_m", lidar.intensity_reference_m},
          {"lidar.signal_spread", lidar.signal_spread},
          {"lidar.max_incidence_deg", lidar.max_incidence_deg},
          {"lidar.dropout_share", lidar.dropout_share},
          {"lidar.format", s.kitti_scans ? "kitti" : "ply"}};
}

template <class Command>
const Command& command(const tf::vehicle::FlightPlan& plan, std::size_t step) {
  return std::get<Command>(plan.mission.at(step).command);
}

json vehicle_defaults(const tf::vehicle::VehiclePlan& plan) {
  const tf::vehicle::VehicleOptions& o = plan.options;
  return {{"wind_m_s", numbers(o.wind.mean_m_s)},
          {"turbulence", o.wind.turbulence == tf::vehicle::Turbulence::kNone ? "none" : "another"},
          {"height_above_ground_m", o.wind.height_above_ground_m},
          {"seed", o.wind.seed},
          {"collision", o.collision == tf::vehicle::CollisionPolicy::kOff ? "off" : "another"},
          {"restitution", o.bounce.restitution},
          {"friction", o.bounce.friction},
          {"radius_m", o.radius_m},
          {"mass_kg", o.quadrotor.body.mass_kg},
          {"linear_drag", numbers(o.quadrotor.linear_drag_n_s_m)},
          {"quadratic_drag", numbers(o.quadrotor.quadratic_drag_n_s2_m2)},
          {"mount", plan.mount.gimbal ? "gimbal" : "fixed"},
          {"pitch_deg", plan.mount.pitch_deg},
          {"offset_m", numbers(plan.mount.offset_m)},
          {"start", numbers(plan.start_m)},
          {"start_heading_deg", tf::vehicle::heading_to_yaw_rad(0.0) == plan.start_yaw_rad ? json(0.0) : json()},
          {"landed", plan.landed}};
}

json autopilot_defaults(const tf::vehicle::AutopilotPlan& plan) {
  return {{"model", plan.hexarotor ? "hexarotor" : "quadrotor"},
          {"start", numbers(plan.start_m)},
          {"start_heading_deg", plan.start_heading_deg},
          {"wind_m_s", numbers(plan.wind_m_s)},
          {"mount", plan.mount.gimbal ? "gimbal" : "fixed"},
          {"pitch_deg", plan.mount.pitch_deg},
          {"offset_m", numbers(plan.mount.offset_m)},
          {"gnss", plan.gnss},
          {"vision.source", plan.vision.source == tf::vehicle::VisionPlan::Source::kNone ? "none" : "another"},
          {"vision.rate_hz", plan.vision.rate_hz},
          {"vision.latency_s", plan.vision.latency_s},
          {"vision.width", plan.vision.width},
          {"vision.height", plan.vision.height},
          {"vision.fov_deg", plan.vision.fov_deg},
          {"vision.pitch_deg", plan.vision.pitch_deg},
          {"vision.offset_m", numbers(plan.vision.offset_m)},
          {"duration_s", plan.duration_s},
          {"connect_timeout_s", plan.connect_timeout_s},
          {"silence_s", plan.silence_s}};
}

/// Returns the defaults of a flight whose mission has every command, in the order of the schema.
json mission_defaults(const tf::vehicle::FlightPlan& plan) {
  using namespace tf::vehicle;
  const auto& rises = command<TakeOff>(plan, 0);
  const auto& path = command<FollowPath>(plan, 3);
  const auto& velocity = command<FlyVelocity>(plan, 5);
  const auto drivetrain = [](Drivetrain d) { return d == Drivetrain::kMaxDegreeOfFreedom ? "free" : "forward"; };
  json result = {{"takeoff.height_m", rises.height_m},
                 {"takeoff.speed_m_s", rises.speed_m_s},
                 {"takeoff.timeout_s", rises.timeout_s},
                 {"land.speed_m_s", command<Land>(plan, 1).speed_m_s},
                 {"land.timeout_s", command<Land>(plan, 1).timeout_s},
                 {"hover.duration_s", command<Hover>(plan, 2).duration_s},
                 {"velocity.duration_s", velocity.duration_s},
                 {"velocity.frame", velocity.frame == VelocityFrame::kLocal ? "local" : "heading"},
                 {"velocity.drivetrain", drivetrain(velocity.drivetrain)},
                 {"turn.timeout_s", command<TurnToYaw>(plan, 6).timeout_s},
                 {"turn_rate.duration_s", command<TurnAtRate>(plan, 7).duration_s}};
  for (const std::string word : {"go_to", "path"}) {
    result[word + ".speed_m_s"] = path.speed_m_s;
    result[word + ".timeout_s"] = path.timeout_s;
    result[word + ".drivetrain"] = drivetrain(path.drivetrain);
  }
  return result;
}

json event_defaults(const std::string& prefix) {
  const tf::events::EventOptions events;
  return {{prefix + "positive_threshold", events.positive_threshold},
          {prefix + "negative_threshold", events.negative_threshold},
          {prefix + "threshold_sigma", events.threshold_sigma},
          {prefix + "dark_light", events.dark_light},
          {prefix + "refractory_s", events.refractory_s},
          {prefix + "leak_rate_hz", events.leak_rate_hz},
          {prefix + "shot_noise_rate_hz", events.shot_noise_rate_hz},
          {prefix + "max_motion_px", events.max_motion_px},
          {prefix + "max_change", events.max_change},
          {prefix + "max_step_s", events.max_step_s},
          {prefix + "max_rate_hz", events.max_rate_hz}};
}

constexpr const char* kMission = R"(camera: cam.yaml
fps: 2
speed_m_s:
vehicle: {}
mission:
- {do: takeoff}
- {do: land}
- {do: hover}
- {do: go_to, position: [0, 0, 9]}
- {do: path, points: [0, 0, 9, 9, 0, 9]}
- {do: velocity, velocity_m_s: [1, 0, 0]}
- {do: turn, heading_deg: 9}
- {do: turn_rate, yaw_rate_deg_s: 9}
)";
constexpr const char* kAutopilot = "camera: cam.yaml\nfps: 2\nautopilot: {kind: px4, vision: {}}\n";
constexpr const char* kSensors =
    "imu: {}\ngnss: {}\nattitude: {}\nbarometer: {}\nmagnetometer: {}\nrange_finder: {}\nlidar: {}\n";
constexpr const char* kWaypoints =
    "camera: cam.yaml\nfps: 2\nsensors_file: sensors.yaml\nwaypoints:\n- {position: [0, 0, 9]}\n- {position: [9, 0, "
    "9]}\n";
constexpr const char* kExperiment =
    "place: {source: 'stadium:twin'}\nsimulated: {render: {flight: waypoints.yaml, degrade: {light: {}, auto_exposure: "
    "{}, exposure_steps: [{}]}}}\n";

int print_defaults(const fs::path& folder) {
  const auto plan = tf::vehicle::read_flight_plan(written(folder, "mission.yaml", kMission));
  const auto by_autopilot = tf::vehicle::read_flight_plan(written(folder, "autopilot.yaml", kAutopilot));
  written(folder, "sensors.yaml", kSensors);
  const fs::path flight_file = written(folder, "waypoints.yaml", kWaypoints);
  const auto waypoints = tf::vehicle::read_flight_plan(flight_file);
  const tf::scene::ActorPlan actor =
      tf::scene::read_actors(written(folder, "actors.yaml", "actors: [{position: [0, 0]}]\n")).at(0);
  const tf::render::WeatherOptions weather =
      tf::render::read_weather(written(folder, "weather.yaml", "weather: {}\n")).value();
  const auto experiment = tf::experiment::read_experiment(written(folder, "experiment.yaml", kExperiment));
  const tf::recording::RenderedFlightConfig& render = *experiment.simulated->render;
  const tf::ingest::IngestedFlightConfig ingest{};
  const json degrade = degrade_defaults(*render.degrade);
  const json sensors = sensor_defaults(tf::sensors::read_sensor_suite(flight_file, 1, {}));
  json flight = {{"speed_m_s", waypoints.limits.speed_m_s},
                 {"acceleration_m_s2", waypoints.limits.acceleration_m_s2},
                 {"yaw_rate_deg_s", waypoints.limits.yaw_rate_deg_s},
                 {"waypoints[].yaw_deg", waypoints.waypoints.at(0).yaw_deg},
                 {"waypoints[].pitch_deg", waypoints.waypoints.at(0).pitch_deg},
                 {"waypoints[].roll_deg", waypoints.waypoints.at(0).roll_deg},
                 {"weather.base_height_m", weather.base_height_m},
                 {"weather.rain_mm_per_h", weather.rain_mm_per_h},
                 {"weather.snow_mm_per_h", weather.snow_mm_per_h},
                 {"weather.wetness", weather.wetness},
                 {"weather.streak_exposure_s", weather.streak_exposure_s},
                 {"cameras[].offset_s", tf::recording::MountedCamera().offset_s},
                 {"actors[].model", tf::scene::make_model(actor.model).name},
                 {"actors[].scale", actor.scale},
                 {"actors[].yaw_deg", actor.route.yaw_deg},
                 {"actors[].start_s", actor.route.start_s},
                 {"actors[].loop", actor.route.loops},
                 {"actors[].on_ground", actor.route.follows_ground}};
  for (const char* prefix : {"events.", "cameras[].events."}) flight.update(event_defaults(prefix));
  std::cout << json{{"experiment.alignment", alignment_defaults(experiment.alignment)},
                    {"experiment.evaluation", evaluation_defaults(experiment.evaluation)},
                    {"experiment.odometry", odometry_defaults(experiment.odometry)},
                    {"experiment.place", site_defaults(experiment.place)},
                    {"experiment.truth",
                     {{"voxel", experiment.truth.voxel_m}, {"samples_per_m2", experiment.truth.samples_per_m2}}},
                    {"experiment", {{"seed", experiment.seed}, {"simulated.kind", experiment.simulated->kind}}},
                    {"experiment.simulated.render", {{"samples_per_pixel", render.samples_per_pixel}}},
                    {"experiment.simulated.ingest",
                     {{"sync_tolerance", ingest.sync_tolerance_s}, {"imu_time_offset", ingest.imu_time_offset_s}}},
                    {"experiment.real.ingest",
                     {{"sync_tolerance", ingest.sync_tolerance_s}, {"imu_time_offset", ingest.imu_time_offset_s}}},
                    {"degrade", degrade},
                    {"sensors", sensors},
                    {"flight.vehicle", vehicle_defaults(*plan.vehicle)},
                    {"flight.mission", mission_defaults(plan)},
                    {"flight.autopilot", autopilot_defaults(*by_autopilot.autopilot)},
                    {"flight", flight}}
                   .dump()
            << "\n";
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc == 3 && std::string(argv[1]) == "--defaults") return print_defaults(argv[2]);
  return read_all();
}
