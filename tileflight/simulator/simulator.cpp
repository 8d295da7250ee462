#include "tileflight/simulator/simulator.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <utility>

#include "tileflight/geometry/input_error.h"
#include "tileflight/sensors/earth_field.h"
#include "tileflight/simulator/camera_settings.h"
#include "tileflight/simulator/frames.h"
#include "tileflight/simulator/simulator_impl.h"

namespace tileflight::simulator {
namespace {

using geometry::SE3;
using geometry::Vec3;

constexpr double kFar_m = 1e7;
/// A vehicle whose start is below the ground by no more than this stands on it.
constexpr double kBelowGround_m = 0.5;
/// Between a vehicle that stands and the ground: rounding must not make it touch.
constexpr double kStandsAbove_m = 0.005;
/// What a vehicle's own surroundings need of the tiles where nothing sharper looks: collisions.
constexpr double kLeastPixelsPerRad = 100.0;
constexpr double kMagneticYear = 2025.5;
constexpr double kTesla_to_gauss = 1e4;
constexpr double kMicro = 1e-6;

SimulatorOptions with_settings(SimulatorOptions options, const Settings& settings) {
  if (settings.origin) options.load.origin = settings.origin;
  return options;
}

}  // namespace

Vec3 checked_position(const Vector3r& position, const char* what) {
  const Vec3 p = vec3(position);
  if (!p.allFinite() || p.cwiseAbs().maxCoeff() > kFar_m)
    throw InputError(what, "a coordinate is not finite or farther than 10000 km");
  return p;
}

Eigen::Quaterniond checked_rotation(const Quaternionr& orientation, const char* what) {
  const Eigen::Quaterniond q = quaternion(orientation);
  if (!q.coeffs().allFinite() || q.norm() < 1e-6) throw InputError(what, "the orientation is no quaternion");
  return q.normalized();
}

SE3 merged_pose(const Pose& pose, const SE3& before, const char* what) {
  Vector3r position = pose.position;
  const Vector3r old = wire(before.translation);
  if (std::isnan(position.x_val)) position.x_val = old.x_val;
  if (std::isnan(position.y_val)) position.y_val = old.y_val;
  if (std::isnan(position.z_val)) position.z_val = old.z_val;
  const bool turned = !quaternion(pose.orientation).coeffs().hasNaN();
  return {turned ? checked_rotation(pose.orientation, what) : before.rotation, checked_position(position, what)};
}

Simulator::Impl::Impl(const SimulatorOptions& o, SimulatorLog l, const Progress& progress)
    : options(o),
      log(std::move(l)),
      settings(read_settings(options.settings, options.settings_name)),
      world(with_settings(options, settings), log, progress),
      earth{geometry::LocalFrame(kDefaultOrigin), {}, Vec3::Zero(), false},
      files(options.files),
      ids(settings.random_ids),
      engine(state, settings.clock, hooks()) {
  begin();
}

Simulator::Impl::Impl(const SimulatorOptions& o, std::vector<imaging::TexturedMesh> meshes, SimulatorLog l)
    : options(o),
      log(std::move(l)),
      settings(read_settings(options.settings, options.settings_name)),
      world(with_settings(options, settings), std::move(meshes), log),
      earth{geometry::LocalFrame(kDefaultOrigin), {}, Vec3::Zero(), false},
      files(options.files),
      ids(settings.random_ids),
      engine(state, settings.clock, hooks()) {
  begin();
}

void Simulator::Impl::say(const std::string& line) const {
  if (log) log(line);
}

void Simulator::Impl::begin() {
  warnings = settings.warnings;
  warnings.insert(warnings.end(), world.warnings().begin(), world.warnings().end());
  set_frames();
  wind_ned_m_s = settings.wind_ned_m_s;
  for (const CameraSettings& external : settings.external_cameras) external_cameras.emplace_back(external);
  for (const VehicleSettings& vehicle : settings.vehicles) add_vehicle(vehicle, home_of(vehicle));
  world.for_looks(looks());
  obstacles_place = world.current();
  if (settings.recording.enabled) begin_recording();
  engine.start();
}

/// Where NED has its origin: as asked for, or on the surface at the frame's origin, or at the middle of the place.
void Simulator::Impl::set_frames() {
  Vec3 start = options.start_local.value_or(Vec3(0.0, 0.0, NAN));
  if (!start.head<2>().allFinite()) throw InputError("start", "its coordinates must be finite");
  const bool on_surface = !std::isfinite(start.z());
  if (on_surface && !settings.start_on_surface) start.z() = 0.0;
  if (!std::isfinite(start.z())) {
    auto surface = world.surface_z(start.x(), start.y(), kFar_m);
    if (!surface && !options.start_local) {
      start.head<2>() = world.center().head<2>();
      surface = world.surface_z(start.x(), start.y(), kFar_m);
      warnings.push_back("there is no surface at the origin: vehicles start at the middle of the place");
    }
    start.z() = surface.value_or(world.center().z());
  }
  T_local_ned = T_local_ned_at(start);
  earth.georeferenced = world.local_frame().has_value();
  if (earth.georeferenced) earth.frame = *world.local_frame();
  earth.T_local_ned = earth.georeferenced ? T_local_ned : T_local_ned_at(Vec3::Zero());
  earth.field_ned_gauss =
      ned_of_enu(sensors::earth_field_ut(earth.frame, earth.T_local_ned.translation, kMagneticYear)) * kMicro *
      kTesla_to_gauss;
}

/// A vehicle that flies stands on what is below its start; one that starts below the ground stands on the ground.
SE3 Simulator::Impl::home_of(const VehicleSettings& vehicle) const {
  SE3 home(vehicle.R_ned_body, vehicle.start_ned);
  if (!vehicle.flies) return home;
  const Vec3 start = T_local_ned * vehicle.start_ned;
  auto ground = world.surface_z(start.x(), start.y(), start.z() + kBelowGround_m);
  if (!ground) ground = world.surface_z(start.x(), start.y(), kFar_m);
  const double radius_m = flight::VehicleOptions{}.radius_m + kStandsAbove_m;
  if (ground) home.translation = T_local_ned.inverse() * Vec3(start.x(), start.y(), *ground + radius_m);
  // It stands level.
  home.rotation = Eigen::Quaterniond(Eigen::AngleAxisd(heading_rad(vehicle.R_ned_body), Vec3::UnitZ()));
  return home;
}

void Simulator::Impl::add_vehicle(VehicleSettings vehicle, const SE3& home) {
  auto added = std::make_unique<Fleet>();
  added->craft = std::make_unique<Craft>(std::move(vehicle), T_local_ned, obstacles(), enu_of_ned(wind_ned_m_s));
  added->craft->set_home(home);
  fleet.push_back(std::move(added));
}

/// Asked with the mutex held: in steps and by commands.
flight::Obstacles Simulator::Impl::obstacles() {
  return [this](const Vec3& from, const Vec3& to) -> std::optional<flight::SurfaceHit> {
    const Vec3 way = to - from;
    const double length_m = way.norm();
    if (!obstacles_place || length_m <= 0.0) return std::nullopt;
    const scene::Scene& scene = obstacles_place->scene();
    const auto hit = scene.intersect({from, way / length_m}, length_m);
    if (!hit) return std::nullopt;
    const Vec3 normal = scene.normal(*hit);
    if (normal.squaredNorm() <= 0.0) return std::nullopt;
    return flight::SurfaceHit{scene.position(*hit), normal};
  };
}

Engine::Hooks Simulator::Impl::hooks() {
  Engine::Hooks hooks;
  hooks.step = [this](double time_s) {
    constexpr double kKeep_s = 0.5;
    for (const auto& one : fleet) {
      one->craft->step(time_s);
      one->history.add(time_s, one->craft->state(), kKeep_s);
    }
  };
  hooks.busy = [this] { return std::ranges::any_of(fleet, [](const auto& one) { return one->craft->busy(); }); };
  hooks.after_step = [this](double time_s) {
    if (world.follows()) {
      std::vector<Look> wanted;
      {
        const std::lock_guard lock(state);
        wanted = looks();
      }
      try {
        const auto place = world.for_looks(wanted);
        const std::lock_guard lock(state);
        obstacles_place = place;
      } catch (const InputError& error) {
        say(error.what());
      }
    }
    record_if_due(time_s);
  };
  return hooks;
}

Fleet& Simulator::Impl::vehicle(const std::string& name) {
  return const_cast<Fleet&>(std::as_const(*this).vehicle(name));
}

const Fleet& Simulator::Impl::vehicle(const std::string& name) const {
  if (name.empty()) return *fleet.front();
  for (const auto& one : fleet) {
    if (one->craft->name() == name) return *one;
  }
  throw std::runtime_error("Vehicle API for '" + name.substr(0, 100) +
                           "' is not available. This could either because this is simulation-only API or this vehicle "
                           "does not exist");
}

Craft& Simulator::Impl::flying(const std::string& name, const char* call) {
  Craft& craft = *vehicle(name).craft;
  if (!craft.settings().flies) {
    throw std::runtime_error("Vehicle API for '" + craft.name() + "' is not available: " + call +
                             " is for vehicles that fly, and in the mode ComputerVision there are none");
  }
  return craft;
}

SimCamera& Simulator::Impl::camera(const std::string& name, const std::string& vehicle_name, bool external) {
  return const_cast<SimCamera&>(std::as_const(*this).camera(name, vehicle_name, external));
}

const SimCamera& Simulator::Impl::camera(const std::string& name, const std::string& vehicle_name,
                                         bool external) const {
  const auto& cameras = external ? external_cameras : vehicle(vehicle_name).craft->cameras();
  // A camera of the settings may be called "0"; else that stands for front_center.
  for (const std::string& wanted : {name, camera_of_alias(name)}) {
    const auto at = std::ranges::find(cameras, wanted, &SimCamera::name);
    if (at != cameras.end()) return *at;
  }
  std::string known;
  for (const SimCamera& one : cameras) known += (known.empty() ? "" : ", ") + one.name();
  throw InputError("camera '" + name.substr(0, 100) + "'", "there is none of that name; there are: " + known);
}

SE3 Simulator::Impl::T_ned_camera(const SimCamera& camera, const std::string& name, bool external) const {
  if (external) return camera.T_body_camera();
  return vehicle(name).craft->state().T_ned_body * camera.T_body_camera();
}

Vec3 Simulator::Impl::origin_of(const std::string& name, bool external) const {
  return external ? Vec3(Vec3::Zero()) : vehicle(name).craft->start_ned();
}

std::vector<Look> Simulator::Impl::looks() const {
  if (!world.follows()) return {};
  std::vector<Look> looks;
  for (const auto& one : fleet) {
    const Craft& craft = *one->craft;
    const SE3 T_local_body = T_local_ned * craft.state().T_ned_body;
    double least = kLeastPixelsPerRad;
    for (const SensorSettings& sensor : craft.settings().sensors) {
      if (const auto* lidar = std::get_if<LidarSettings>(&sensor.kind)) least = std::max(least, rays_per_rad(*lidar));
    }
    looks.push_back({T_local_body.translation, least});
    for (const SimCamera& camera : craft.cameras())
      looks.push_back({T_local_body * camera.T_body_camera().translation, camera.pixels_per_rad()});
  }
  for (const SimCamera& camera : external_cameras)
    looks.push_back({T_local_ned * camera.T_body_camera().translation, camera.pixels_per_rad()});
  return looks;
}

Simulator::Simulator(const SimulatorOptions& options, SimulatorLog log, const Progress& progress)
    : impl_(std::make_unique<Impl>(options, std::move(log), progress)) {}

Simulator::Simulator(const SimulatorOptions& options, std::vector<imaging::TexturedMesh> meshes, SimulatorLog log)
    : impl_(std::make_unique<Impl>(options, std::move(meshes), std::move(log))) {}

Simulator::~Simulator() { stop(); }

void Simulator::stop() {
  {
    const std::lock_guard lock(impl_->state);
    for (const auto& one : impl_->fleet) one->craft->cancel();
  }
  impl_->engine.stop();
}

std::optional<int> Simulator::settings_port() const { return impl_->settings.port; }
std::optional<std::string> Simulator::settings_address() const { return impl_->settings.address; }
std::vector<std::string> Simulator::warnings() const { return impl_->warnings; }

bool Simulator::ping() const { return true; }
int Simulator::get_server_version() const { return 1; }
int Simulator::get_min_required_client_version() const { return 1; }
std::string Simulator::get_settings_string() const { return impl_->options.settings; }

std::vector<std::string> Simulator::list_vehicles() const {
  const std::lock_guard lock(impl_->state);
  std::vector<std::string> names;
  for (const auto& one : impl_->fleet) names.push_back(one->craft->name());
  return names;
}

void Simulator::reset() {
  const std::lock_guard lock(impl_->state);
  for (const auto& one : impl_->fleet) {
    one->craft->reset();
    one->history.clear();
    one->noises.clear();
  }
  impl_->external_cameras.clear();
  for (const CameraSettings& camera : impl_->settings.external_cameras) impl_->external_cameras.emplace_back(camera);
  impl_->last_pictures.clear();
  impl_->engine.wake();
}

void Simulator::sim_pause(bool is_paused) {
  const std::lock_guard lock(impl_->state);
  impl_->engine.set_paused(is_paused);
}

bool Simulator::sim_is_paused() const {
  const std::lock_guard lock(impl_->state);
  return impl_->engine.paused();
}

void Simulator::sim_continue_for_time(double seconds) {
  constexpr double kMost_s = 3600.0;
  if (!(seconds >= 0.0 && seconds <= kMost_s))
    throw InputError("simContinueForTime", "the time must be from 0 to 3600 seconds");
  sim_continue_for_frames(static_cast<std::uint32_t>(std::ceil(seconds / Engine::kStep_s - 1e-6)));
}

void Simulator::sim_continue_for_frames(std::uint32_t frames) {
  constexpr std::uint32_t kMost = 1'200'000;
  if (frames > kMost) throw InputError("simContinueForFrames", "more than 1200000 steps");
  std::unique_lock lock(impl_->state);
  impl_->engine.run_steps(lock, frames);
}

}  // namespace tileflight::simulator
