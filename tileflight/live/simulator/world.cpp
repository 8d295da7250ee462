#include "tileflight/live/simulator/world.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <utility>

#include "tileflight/capture/sensors/magnetometer.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/live/simulator/frames.h"
#include "tileflight/live/simulator/settings.h"

namespace tileflight::simulator {

namespace fs = std::filesystem;

namespace {

constexpr std::size_t kMaxLength = 1000;

bool lies_below(const fs::path& path, const fs::path& root) {
  return std::mismatch(root.begin(), root.end(), path.begin(), path.end()).first == root.end() && path != root;
}

}  // namespace

ClientFileAccess::ClientFileAccess(std::optional<fs::path> root) {
  if (!root) return;
  std::error_code error;
  fs::create_directories(*root, error);
  root_ = fs::canonical(*root, error);
  if (error) throw InputError(root->string(), "cannot be used as the folder for clients' files");
}

fs::path ClientFileAccess::resolve_writable(const std::string& name) const {
  if (!root_) throw InputError("file", "this server does not write files for clients; start it with --files FOLDER");
  if (name.empty() || name.size() > kMaxLength || name.find('\0') != std::string::npos)
    throw InputError("file", "the name is empty or too long");
  const fs::path path = fs::weakly_canonical(*root_ / name);
  if (!lies_below(path, *root_) || !path.has_filename())
    throw InputError("file",
                     "'" + name.substr(0, 200) + "' lies outside the folder that clients may write to (--files)");
  fs::create_directories(path.parent_path());
  return path;
}

namespace {

using geometry::SE3;
using geometry::Vec3;

constexpr double kMaxCoordinate_m = 1e7;
/// A vehicle that starts at most this far below the ground is placed on it.
constexpr double kBelowGround_m = 0.5;
/// Distance of a standing vehicle from the ground, so that rounding does not cause contact.
constexpr double kGroundClearance_m = 0.005;
/// Minimum resolution of the tiles around a vehicle, for collisions.
constexpr double kMinPixelsPerRad = 100.0;
constexpr double kMagneticYear = 2025.5;
constexpr double kGaussPerTesla = 1e4;
constexpr double kMicro = 1e-6;

SimulatorOptions with_settings(SimulatorOptions options, const Settings& settings) {
  if (settings.origin) options.load.origin = settings.origin;
  return options;
}

ClockSettings clock_settings(const SimulatorOptions& options, const Settings& settings) {
  ClockSettings clock = settings.clock;
  clock.driven = options.repeats_session;
  clock.start_ns = options.clock_start_ns;
  return clock;
}

/// Joins the assets of the command line and of the settings.
AssetFiles asset_files(const SimulatorOptions& options, const Settings& settings) {
  AssetFiles files = options.assets;
  files.insert(settings.assets.begin(), settings.assets.end());
  return files;
}

WorkingSet open_place(const SimulatorOptions& options, std::optional<std::vector<imaging::TexturedMesh>> meshes,
                      const SimulatorLog& log, const Progress& progress) {
  if (meshes) return WorkingSet(options, std::move(*meshes), log);
  return WorkingSet(options, log, progress);
}

}  // namespace

Vec3 checked_position(const Vector3r& position, const char* what) {
  const Vec3 p = to_vec3(position);
  if (!p.allFinite() || p.cwiseAbs().maxCoeff() > kMaxCoordinate_m)
    throw InputError(what, "a coordinate is not finite or farther than 10000 km");
  return p;
}

Eigen::Quaterniond checked_rotation(const Quaternionr& orientation, const char* what) {
  const Eigen::Quaterniond q = to_quaternion(orientation);
  if (!q.coeffs().allFinite() || q.norm() < 1e-6) throw InputError(what, "the orientation is not a quaternion");
  return q.normalized();
}

SE3 merge_pose(const Pose& pose, const SE3& before, const char* what) {
  Vector3r position = pose.position;
  const Vector3r old = to_airsim(before.translation);
  if (std::isnan(position.x_val)) position.x_val = old.x_val;
  if (std::isnan(position.y_val)) position.y_val = old.y_val;
  if (std::isnan(position.z_val)) position.z_val = old.z_val;
  const bool turned = !to_quaternion(pose.orientation).coeffs().hasNaN();
  return {turned ? checked_rotation(pose.orientation, what) : before.rotation, checked_position(position, what)};
}

World::World(const SimulatorOptions& o, std::optional<std::vector<imaging::TexturedMesh>> meshes, SimulatorLog l,
             const Progress& progress)
    : options(o),
      log(std::move(l)),
      settings(read_settings(options.settings, options.settings_name)),
      working_set(open_place(with_settings(options, settings), std::move(meshes), log, progress)),
      world_objects(asset_files(options, settings)),
      geodetic_frame{geometry::LocalFrame(kDefaultOrigin), {}, Vec3::Zero(), false},
      file_access(options.output_root),
      segmentation_ids(settings.random_ids),
      annotation_layers(settings.annotation_layers),
      clock(state_mutex, clock_settings(options, settings), clock_hooks()) {
  initialize();
}

void World::log_line(const std::string& line) const {
  if (log) log(line);
}

void World::tell_once(const std::string& call, const std::string& reason) {
  {
    const std::lock_guard lock(state_mutex);
    if (!told_calls.insert(call).second) return;
  }
  log_line("warning: " + call + " has no effect: " + reason);
}

void World::initialize() {
  warnings = settings.warnings;
  warnings.insert(warnings.end(), working_set.warnings().begin(), working_set.warnings().end());
  set_frames();
  wind_ned_m_s = settings.wind_ned_m_s;
  for (const CameraSettings& external : settings.external_cameras) external_cameras.emplace_back(external);
  for (const VehicleSettings& vehicle : settings.vehicles) add_vehicle(vehicle, find_home_pose(vehicle));
  obstacle_scene = working_set.load_for(viewpoints());
  for (const auto& one : vehicles) one->vehicle->settle_at_home();
  open_autopilot_ports();
  if (settings.recording.enabled) begin_recording();
  clock.start();
  for (const auto& port : ardupilot_ports) port->start();
  for (const auto& port : px4_ports) port->start();
}

void World::open_autopilot_ports() {
  const auto ports = options.autopilot_ports ? options.autopilot_ports : std::make_shared<autopilot::SharedPorts>();
  const std::string& address = options.autopilot_address;
  for (const auto& one : vehicles) {
    const auto& autopilot = one->vehicle->settings().autopilot;
    if (!autopilot) continue;
    const LockstepVehicle vehicle(*this, *one);
    const auto port = static_cast<std::uint16_t>(autopilot->port);
    if (options.repeats_session) {
      repeated_vehicles.emplace(vehicle.name(), vehicle);
    } else if (autopilot->kind == AutopilotKind::kArduPilot) {
      ardupilot_ports.push_back(
          std::make_unique<ArduPilotPort>(vehicle, ports->udp(vehicle.name(), address, port), log));
    } else {
      const Px4Pace pace{autopilot->lockstep, settings.clock.speed, settings.clock.on_demand};
      px4_ports.push_back(std::make_unique<Px4Port>(vehicle, ports->tcp(vehicle.name(), address, port), pace, log));
    }
  }
}

/// Sets NED's origin: as requested, else on the surface at the local frame's origin, else at the centre of the place.
void World::set_frames() {
  Vec3 start = options.ned_origin_local.value_or(Vec3(0.0, 0.0, NAN));
  if (!start.head<2>().allFinite()) throw InputError("start", "its coordinates must be finite");
  const bool on_surface = !std::isfinite(start.z());
  if (on_surface && !settings.start_on_surface) start.z() = 0.0;
  if (!std::isfinite(start.z())) {
    auto surface = working_set.surface_z(start.x(), start.y(), kMaxCoordinate_m);
    if (!surface && !options.ned_origin_local) {
      start.head<2>() = working_set.center().head<2>();
      surface = working_set.surface_z(start.x(), start.y(), kMaxCoordinate_m);
      warnings.push_back("there is no surface at the origin: vehicles start at the centre of the place");
    }
    start.z() = surface.value_or(working_set.center().z());
  }
  T_local_ned = T_local_ned_at(start);
  geodetic_frame.georeferenced = working_set.local_frame().has_value();
  if (geodetic_frame.georeferenced) geodetic_frame.local_frame = *working_set.local_frame();
  geodetic_frame.T_local_ned = geodetic_frame.georeferenced ? T_local_ned : T_local_ned_at(Vec3::Zero());
  geodetic_frame.magnetic_field_ned_gauss =
      ned_from_enu(sensors::geomagnetic_field_ut(geodetic_frame.local_frame, geodetic_frame.T_local_ned.translation,
                                                 kMagneticYear)) *
      kMicro * kGaussPerTesla;
}

/// A flying vehicle stands on the surface below its start; one that starts below the ground stands on the ground. A
/// vehicle that does not fly stays at its start, unless that is in the ground or below it: then it stands there, too.
SE3 World::find_home_pose(const VehicleSettings& vehicle) const {
  SE3 home(vehicle.R_ned_body, vehicle.start_ned);
  const Vec3 start = T_local_ned * vehicle.start_ned;
  auto ground = working_set.surface_z(start.x(), start.y(), start.z() + kBelowGround_m);
  if (!ground) ground = working_set.surface_z(start.x(), start.y(), kMaxCoordinate_m);
  const double standing_z = ground.value_or(start.z()) + vehicle::VehicleOptions{}.radius_m + kGroundClearance_m;
  if (ground && (vehicle.flies || start.z() < standing_z))
    home.translation = T_local_ned.inverse() * Vec3(start.x(), start.y(), standing_z);
  if (!vehicle.flies) return home;
  // The vehicle stands level.
  home.rotation = Eigen::Quaterniond(Eigen::AngleAxisd(heading_rad(vehicle.R_ned_body), Vec3::UnitZ()));
  return home;
}

void World::add_vehicle(VehicleSettings vehicle, const SE3& home) {
  auto added = std::make_unique<VehicleSlot>();
  added->vehicle =
      std::make_unique<SimVehicle>(std::move(vehicle), T_local_ned, obstacle_query(), enu_from_ned(wind_ned_m_s));
  added->vehicle->set_home(home);
  const VehicleSettings& own = added->vehicle->settings();
  if (own.autopilot && own.autopilot->vision.uses_camera())
    added->vision = std::make_unique<VisionInput>(own, kPx4Step_s, vision_tiles(own), log);
  vehicles.push_back(std::move(added));
}

std::shared_ptr<WorkingSet> World::vision_tiles(const VehicleSettings& vehicle) const {
  const VisionSettings& vision = vehicle.autopilot->vision;
  if (vision.source != VisionSource::kPlace) return nullptr;
  const auto& frame = working_set.local_frame();
  if (vision.place.empty() && options.source.empty())
    throw InputError("VisionPlace", "the place was not read from tiles: name the tiles to locate pictures in");
  SimulatorOptions tiles{.source = vision.place.empty() ? options.source : vision.place, .load = options.load};
  if (frame) tiles.load.origin = frame->origin();
  tiles.residency = options.residency;
  tiles.max_memory_bytes = options.max_memory_bytes / 2;
  tiles.max_distance_m = options.max_distance_m;
  auto working = std::make_shared<WorkingSet>(tiles, log, Progress{});
  if (working->local_frame().has_value() != frame.has_value())
    throw InputError("VisionPlace", tiles.source + (frame ? " is not georeferenced, the place that is flown over is"
                                                          : " is georeferenced, the place that is flown over is not"));
  return working;
}

/// Called with the mutex held: in steps and by commands.
vehicle::ObstacleQuery World::obstacle_query() {
  return [this](const Vec3& from, const Vec3& to) -> std::optional<vehicle::SurfaceHit> {
    const Vec3 way = to - from;
    const double length_m = way.norm();
    if (!obstacle_scene || length_m <= 0.0) return std::nullopt;
    const scene::Scene& scene = obstacle_scene->scene();
    const auto hit = scene.intersect({from, way / length_m}, length_m);
    if (!hit) return std::nullopt;
    const Vec3 normal = scene.normal(*hit);
    if (normal.squaredNorm() <= 0.0) return std::nullopt;
    const bool is_object = hit->mesh >= scene.first_placed_mesh();
    return vehicle::SurfaceHit{scene.position(*hit), normal,
                               is_object ? scene.placed()[scene.placed_of_mesh(hit->mesh)].name : std::string()};
  };
}

SimulationClock::Hooks World::clock_hooks() {
  SimulationClock::Hooks hooks;
  hooks.step = [this](double time_s) {
    for (const auto& one : vehicles) {
      if (one->vehicle->has_autopilot()) continue;  // its own steps are others
      one->vehicle->step(time_s);
      one->history.add(time_s, one->vehicle->state(), kHistory_s);
    }
  };
  hooks.busy = [this] { return std::ranges::any_of(vehicles, [](const auto& one) { return one->vehicle->busy(); }); };
  hooks.after_step = [this](double time_s) {
    if (working_set.follows_sensors()) {
      std::vector<SensorViewpoint> views;
      {
        const std::lock_guard lock(state_mutex);
        views = viewpoints();
      }
      try {
        const auto place = place_for(views);
        const std::lock_guard lock(state_mutex);
        obstacle_scene = place;
      } catch (const InputError& error) {
        log_line(error.what());
      }
    }
    record_if_due(time_s);
  };
  return hooks;
}

std::shared_ptr<const ResidentScene> World::place_for(std::span<const SensorViewpoint> viewpoints) {
  return world_objects.populate(working_set.load_for(viewpoints), world_objects.now(), T_local_ned);
}

std::shared_ptr<const ResidentScene> World::place_now() {
  return world_objects.populate(working_set.current(), world_objects.now(), T_local_ned);
}

void World::update_obstacles() {
  const auto place = place_now();
  const std::lock_guard lock(state_mutex);
  obstacle_scene = place;
}

VehicleSlot& World::slot(const std::string& name) const {
  if (name.empty()) return *vehicles.front();
  for (const auto& one : vehicles) {
    if (one->vehicle->name() == name) return *one;
  }
  throw std::runtime_error("Vehicle API for '" + name.substr(0, 100) +
                           "' is not available. This could either because this is simulation-only API or this vehicle "
                           "does not exist");
}

SimVehicle& World::require_multirotor(const std::string& name, const char* call) {
  SimVehicle& sim_vehicle = *slot(name).vehicle;
  if (!sim_vehicle.settings().flies) {
    throw std::runtime_error("Vehicle API for '" + sim_vehicle.name() + "' is not available: " + call +
                             " is for vehicles that fly, and in the mode ComputerVision there are none");
  }
  return sim_vehicle;
}

SimCamera& World::camera(const std::string& name, const std::string& vehicle_name, bool external) {
  auto& cameras = external ? external_cameras : slot(vehicle_name).vehicle->cameras();
  // A camera in the settings may be named "0"; otherwise this means front_center.
  for (const std::string& candidate : {name, resolve_camera_alias(name)}) {
    const auto at = std::ranges::find(cameras, candidate, &SimCamera::name);
    if (at != cameras.end()) return *at;
  }
  std::string known;
  for (const SimCamera& one : cameras) known += (known.empty() ? "" : ", ") + one.name();
  throw InputError("camera '" + name.substr(0, 100) + "'", "does not exist; the cameras are: " + known);
}

SE3 World::T_ned_camera(const SimCamera& camera, const std::string& vehicle_name, bool external) const {
  if (external) return camera.T_body_camera();
  return slot(vehicle_name).vehicle->state().T_ned_body * camera.T_body_camera();
}

Vec3 World::ned_origin(const std::string& vehicle_name, bool external) const {
  return external ? Vec3(Vec3::Zero()) : slot(vehicle_name).vehicle->start_ned();
}

std::vector<SensorViewpoint> World::viewpoints() const {
  if (!working_set.follows_sensors()) return {};
  std::vector<SensorViewpoint> viewpoints;
  for (const auto& one : vehicles) {
    const SimVehicle& sim_vehicle = *one->vehicle;
    const SE3 T_local_body = T_local_ned * sim_vehicle.state().T_ned_body;
    double least = kMinPixelsPerRad;
    for (const SensorSettings& sensor : sim_vehicle.settings().sensors) {
      if (const auto* lidar = std::get_if<LidarSettings>(&sensor.kind)) least = std::max(least, rays_per_rad(*lidar));
    }
    viewpoints.push_back({T_local_body.translation, least});
    for (const SimCamera& camera : sim_vehicle.cameras())
      viewpoints.push_back({T_local_body * camera.T_body_camera().translation, camera.pixels_per_rad()});
  }
  for (const SimCamera& camera : external_cameras)
    viewpoints.push_back({T_local_ned * camera.T_body_camera().translation, camera.pixels_per_rad()});
  return viewpoints;
}

SensorContext World::sensor_context(const VehicleSlot& one) const {
  return {*one.vehicle, one.history, geodetic_frame, clock.time_s(), clock.time_ns(), one.vehicle->is_flying()};
}

}  // namespace tileflight::simulator
