#include <algorithm>
#include <map>
#include <stdexcept>

#include "tileflight/core/base/input_error.h"
#include "tileflight/live/simulator/frames.h"
#include "tileflight/live/simulator/simulator_impl.h"

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
      {"setSafety", "there is no safety evaluation; find obstacles with tfGroundTruth and getDistanceSensorData"},
  };
  if (const auto at = kReasons.find(call); at != kReasons.end()) return at->second;
  if (call.find("Car") != std::string::npos)
    return "cars are not simulated; set SimMode to Multirotor or ComputerVision in the settings";
  return "cameras have no focus, aperture or film; set their lenses with simSetCameraFov and tfSetLens";
}

}  // namespace

void Simulator::refuse(const std::string& name) const {
  throw std::runtime_error(name.substr(0, kMaxNameLength) + " is not served here: " + unsupported_reason(name));
}

void Simulator::accept_without_effect(const std::string& name) { tell_once(name, ineffective_reason(name)); }

void Simulator::tell_once(const std::string& call, const std::string& reason) {
  {
    const std::lock_guard lock(impl_->state_mutex);
    if (!impl_->told_calls.insert(call).second) return;
  }
  impl_->log_line("warning: " + call + " has no effect: " + reason);
}

bool Simulator::sim_run_console_command(const std::string& /*command*/) { return false; }

void Simulator::sim_print_log_message(const std::string& message, const std::string& parameter, int severity) {
  constexpr std::size_t kLongest = 500;
  std::string line = message.substr(0, kLongest) + " " + parameter.substr(0, kLongest);
  for (char& c : line) {
    if (static_cast<unsigned char>(c) < 0x20) c = ' ';
  }
  impl_->log_line("client (" + std::to_string(severity) + "): " + line);
}

bool Simulator::sim_add_vehicle(const std::string& name, const std::string& type, const Pose& pose,
                                const std::string& /*pawn_path*/) {
  const bool flies = type == "SimpleFlight" || type == "simpleflight";
  if (!flies && type != "ComputerVision" && type != "computervision")
    throw InputError("simAddVehicle",
                     "the type '" + type.substr(0, kMaxNameLength) + "' must be SimpleFlight or ComputerVision");
  if (flies == impl_->settings.computer_vision) return false;  // as AirSim: vehicles of the other mode are rejected
  if (name.empty() || name.size() > kMaxNameLength) throw InputError("simAddVehicle", "the name is empty or too long");
  VehicleSettings vehicle = default_vehicle(name, flies, impl_->settings.camera_defaults);
  vehicle.start_ned = checked_position(pose.position, "simAddVehicle");
  vehicle.R_ned_body = checked_rotation(pose.orientation, "simAddVehicle");
  const geometry::SE3 home = impl_->find_home_pose(vehicle);
  const std::lock_guard lock(impl_->state_mutex);
  if (impl_->vehicles.size() >= kMaxVehicles)
    throw InputError("simAddVehicle", "there are " + std::to_string(kMaxVehicles) + " vehicles already");
  const bool known =
      std::ranges::any_of(impl_->vehicles, [&](const auto& one) { return one->vehicle->name() == name; });
  if (known) return false;
  impl_->add_vehicle(std::move(vehicle), home);
  return true;
}

}  // namespace tileflight::simulator
