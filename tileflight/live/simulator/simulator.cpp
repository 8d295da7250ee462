#include "tileflight/live/simulator/simulator.h"

#include <map>
#include <stdexcept>

#include "tileflight/core/base/input_error.h"
#include "tileflight/live/simulator/world.h"

namespace tileflight::simulator {
namespace {

constexpr std::size_t kMaxNameLength = 100;

constexpr const char* kNoManualControl =
    "remote control and motor commands are not simulated; use moveByVelocity or moveByAngleRatesThrottle";
constexpr const char* kBakedLight =
    "there are no lamps, and light and shadows are part of the tiles' textures; simSetTimeOfDay lights the place by "
    "sun and sky";
constexpr const char* kNoRadio = "radio is not simulated; distances are measured by getDistanceSensorData";
constexpr const char* kBakedTextures =
    "the tiles' textures cannot be changed; mark objects with simSetSegmentationObjectID";

/// Why a call is accepted without effect.
std::string ineffective_reason(const std::string& call) {
  static const std::map<std::string, std::string> kReasons{
      {"simSetLightIntensity", kBakedLight},        {"simSetWorldLightVisibility", kBakedLight},
      {"simSetWorldLightIntensity", kBakedLight},   {"simSetVehicleLightVisibility", kBakedLight},
      {"simSetVehicleLightIntensity", kBakedLight}, {"simSwapTextures", kBakedTextures},
      {"simSetObjectMaterial", kBakedTextures},     {"simSetObjectMaterialFromTexture", kBakedTextures},
  };
  if (const auto at = kReasons.find(call); at != kReasons.end()) return at->second;
  if (call.find("Texture") != std::string::npos) return "annotation layers of textures stay empty";
  if (call.ends_with("Gains")) return "the quadrotor has its own controller";
  return "there is no display";
}

/// Why an AirSim call is not supported, and the alternative.
std::string unsupported_reason(const std::string& call) {
  static const std::map<std::string, std::string> kReasons{
      {"simSetExtForce", "external forces are not simulated; simSetWind moves vehicles"},
      {"simSetPhysicsRawKinematics", "there is no second physics engine; set the pose with simSetKinematics"},
      {"getUWBData", kNoRadio},
      {"getUWBSensorData", kNoRadio},
      {"getWifiData", kNoRadio},
      {"getWifiSensorData", kNoRadio},
      {"moveByRC", kNoManualControl},
      {"moveByManual", kNoManualControl},
      {"moveByMotorPWMs", kNoManualControl},
      {"moveByAngleZ", "AirSim has replaced it; use moveByRollPitchYawZ"},
      {"moveByAngleThrottle", "AirSim has replaced it; use moveByRollPitchYawrateThrottle"},
      {"setSafety", "there is no safety evaluation; find obstacles with tfGroundTruth and getDistanceSensorData"},
  };
  if (const auto at = kReasons.find(call); at != kReasons.end()) return at->second;
  if (call.find("Car") != std::string::npos)
    return "cars are not simulated; set SimMode to Multirotor or ComputerVision in the settings";
  return "everything is in focus, and lenses and film have no presets; simGetFocalLength, simGetFilmbackSettings and "
         "simGetCurrentFieldOfView tell them, simSetCameraFov and tfSetLens set them";
}

}  // namespace

Simulator::Simulator(const SimulatorOptions& options, SimulatorLog log, const Progress& progress)
    : world_(std::make_unique<World>(options, std::nullopt, std::move(log), progress)) {}

Simulator::Simulator(const SimulatorOptions& options, std::vector<imaging::TexturedMesh> meshes, SimulatorLog log)
    : world_(std::make_unique<World>(options, std::move(meshes), std::move(log), Progress{})) {}

Simulator::~Simulator() { stop(); }

void Simulator::stop() {
  {
    const std::lock_guard lock(world_->state_mutex);
    for (const auto& one : world_->vehicles) one->vehicle->cancel();
  }
  world_->clock.stop();
  for (const auto& port : world_->ardupilot_ports) port->stop();
  for (const auto& port : world_->px4_ports) port->stop();
}

std::optional<int> Simulator::settings_port() const { return world_->settings.port; }
std::optional<std::string> Simulator::settings_address() const { return world_->settings.address; }
std::vector<std::string> Simulator::warnings() const { return world_->warnings; }

std::vector<AutopilotEndpoint> Simulator::autopilots() const {
  const std::lock_guard lock(world_->state_mutex);
  std::vector<AutopilotEndpoint> endpoints;
  const auto add = [&](const auto& ports, const char* protocol) {
    for (const auto& port : ports) {
      const LockstepVehicle& vehicle = port->vehicle();
      endpoints.push_back({vehicle.name(), protocol, world_->options.autopilot_address, port->port(), vehicle.home(),
                           vehicle.home_heading_deg()});
    }
  };
  add(world_->ardupilot_ports, "ArduPilot JSON, UDP");
  add(world_->px4_ports, "PX4 HIL, TCP");
  return endpoints;
}

bool Simulator::ping() const { return true; }
int Simulator::get_server_version() const { return 1; }
int Simulator::get_min_required_client_version() const { return 1; }
std::string Simulator::get_settings_string() const {
  return is_blank(world_->options.settings) ? default_settings_text() : world_->options.settings;
}

void Simulator::reset() {
  const std::lock_guard lock(world_->state_mutex);
  for (const auto& one : world_->vehicles) {
    one->vehicle->reset();
    one->history.clear();
    one->sensor_noises.clear();
    one->view_noises.clear();
  }
  world_->external_cameras.clear();
  for (const CameraSettings& camera : world_->settings.external_cameras) world_->external_cameras.emplace_back(camera);
  world_->last_pictures.clear();
  world_->clock.wake();
}

Simulator::Turn::Turn(Simulator& simulator) : simulator_(simulator) {
  std::unique_lock lock(simulator_.world_->state_mutex);
  simulator_.world_->clock.take_turn(lock);
  tick_ = simulator_.world_->clock.steps();
}

Simulator::Turn::~Turn() {
  const std::lock_guard lock(simulator_.world_->state_mutex);
  simulator_.world_->clock.end_turn();
}

std::string Simulator::apply(const AutopilotEvent& event) {
  const auto vehicle = world_->repeated_vehicles.find(event.vehicle);
  if (vehicle == world_->repeated_vehicles.end())
    throw InputError("vehicle '" + event.vehicle.substr(0, 100) + "'", "has no autopilot whose flight can be repeated");
  return vehicle->second.apply(event);
}

void Simulator::refuse(const std::string& name) const {
  throw std::runtime_error(name.substr(0, kMaxNameLength) + " is not served here: " + unsupported_reason(name));
}

void Simulator::accept_without_effect(const std::string& name) { world_->tell_once(name, ineffective_reason(name)); }

bool Simulator::run_console_command(const std::string& /*command*/) { return false; }

void Simulator::print_log_message(const std::string& message, const std::string& parameter, int severity) {
  constexpr std::size_t kLongest = 500;
  std::string line = message.substr(0, kLongest) + " " + parameter.substr(0, kLongest);
  for (char& c : line) {
    if (static_cast<unsigned char>(c) < 0x20) c = ' ';
  }
  world_->log_line("client (" + std::to_string(severity) + "): " + line);
}

Statistics Simulator::statistics() const {
  const WorkingSet& tiles = world_->working_set;
  Statistics s;
  s.wall_seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - world_->started).count();
  s.images = world_->images;
  s.image_seconds = world_->image_seconds;
  s.last_image_seconds = world_->last_image_seconds;
  s.scenes_built = tiles.scenes_built();
  s.tiles_read = tiles.tiles_read();
  s.memory_bytes = tiles.memory_bytes();
  s.max_memory_bytes = world_->options.max_memory_bytes;
  s.error_px = static_cast<float>(tiles.error_px());
  s.mode = tiles.follows_sensors() ? "follow" : "region";
  s.warnings = world_->warnings;
  s.attribution = tiles.attribution();
  const std::lock_guard lock(world_->state_mutex);
  s.time_stamp = world_->clock.time_ns();
  s.sim_seconds = world_->clock.time_s();
  for (const auto& one : world_->vehicles) s.tasks_running += one->vehicle->busy() ? 1 : 0;
  s.vehicles = static_cast<int>(world_->vehicles.size());
  return s;
}

}  // namespace tileflight::simulator
