#include <algorithm>
#include <map>
#include <stdexcept>

#include "tileflight/geometry/input_error.h"
#include "tileflight/simulator/frames.h"
#include "tileflight/simulator/simulator_impl.h"

namespace tileflight::simulator {
namespace {

constexpr std::size_t kMostVehicles = 64;
constexpr std::size_t kLongestName = 100;

/// Why a call of AirSim's is not served.
std::string reason_of(const std::string& call) {
  static const std::map<std::string, std::string> kReasons{
      {"simSpawnObject", "objects of a game cannot be put into tiles"},
      {"simLoadLevel", "the place is the one that the server was started with"},
      {"simSetTimeOfDay", "light and shadows are those of the tiles' pictures"},
      {"simEnableWeather", "there is no weather"},
      {"simSetWeatherParameter", "there is no weather"},
      {"simSetObjectMaterial", "tiles look as their pictures do"},
      {"simSetObjectMaterialFromTexture", "tiles look as their pictures do"},
      {"simSwapTextures", "tiles look as their pictures do"},
      {"simSetLightIntensity", "light is that of the tiles' pictures"},
      {"simCharSetFacePreset", "there are no characters"},
      {"moveByRC", "the craft flies under position and velocity control alone; use moveByVelocity"},
      {"moveByManual", "the craft flies under position and velocity control alone; use moveByVelocity"},
      {"moveByMotorPWMs", "the craft flies under position and velocity control alone; use moveByVelocity"},
  };
  if (const auto at = kReasons.find(call); at != kReasons.end()) return at->second;
  if (call.starts_with("moveByRollPitch") || call.starts_with("moveByAngleRates"))
    return "the craft flies under position and velocity control alone; use moveByVelocity";
  if (call.starts_with("simGetDetections") || call.find("Detection") != std::string::npos)
    return "objects are told by segmentation (simGetImages, type 5)";
  return "is not simulated";
}

}  // namespace

void Simulator::refuse(const std::string& name) const {
  throw std::runtime_error(name.substr(0, kLongestName) + " is not served here: " + reason_of(name));
}

void Simulator::accept_without_effect(const std::string& name) {
  impl_->say(name.substr(0, kLongestName) + ": accepted, without effect");
}

bool Simulator::sim_run_console_command(const std::string& /*command*/) { return false; }

void Simulator::sim_print_log_message(const std::string& message, const std::string& parameter, int severity) {
  constexpr std::size_t kLongest = 500;
  std::string line = message.substr(0, kLongest) + " " + parameter.substr(0, kLongest);
  for (char& c : line) {
    if (static_cast<unsigned char>(c) < 0x20) c = ' ';
  }
  impl_->say("client (" + std::to_string(severity) + "): " + line);
}

bool Simulator::sim_add_vehicle(const std::string& name, const std::string& type, const Pose& pose,
                                const std::string& /*pawn_path*/) {
  const bool flies = type == "SimpleFlight" || type == "simpleflight";
  if (!flies && type != "ComputerVision" && type != "computervision")
    throw InputError("simAddVehicle",
                     "the type '" + type.substr(0, kLongestName) + "' is neither SimpleFlight nor ComputerVision");
  if (flies == impl_->settings.computer_vision) return false;  // as AirSim: of the other mode
  if (name.empty() || name.size() > kLongestName) throw InputError("simAddVehicle", "the name is empty or too long");
  VehicleSettings vehicle = default_vehicle(name, flies, impl_->settings.camera_defaults);
  vehicle.start_ned = checked_position(pose.position, "simAddVehicle");
  vehicle.R_ned_body = checked_rotation(pose.orientation, "simAddVehicle");
  const geometry::SE3 home = impl_->home_of(vehicle);
  const std::lock_guard lock(impl_->state);
  if (impl_->fleet.size() >= kMostVehicles) throw InputError("simAddVehicle", "there are 64 vehicles already");
  const bool known = std::ranges::any_of(impl_->fleet, [&](const auto& one) { return one->craft->name() == name; });
  if (known) return false;
  impl_->add_vehicle(std::move(vehicle), home);
  return true;
}

void Simulator::sim_add_detection_filter_mesh_name(const std::string& /*camera*/, int /*image_type*/,
                                                   const std::string& /*mesh_name*/, const std::string& /*vehicle*/,
                                                   bool /*external*/) {
  refuse("simAddDetectionFilterMeshName");
}

void Simulator::sim_set_detection_filter_radius(const std::string& /*camera*/, int /*image_type*/, float /*radius_cm*/,
                                                const std::string& /*vehicle*/, bool /*external*/) {
  refuse("simSetDetectionFilterRadius");
}

void Simulator::sim_clear_detection_mesh_names(const std::string& /*camera*/, int /*image_type*/,
                                               const std::string& /*vehicle*/, bool /*external*/) {
  refuse("simClearDetectionMeshNames");
}

std::vector<DetectionInfo> Simulator::sim_get_detections(const std::string& /*camera*/, int /*image_type*/,
                                                         const std::string& /*vehicle*/, bool /*external*/) {
  refuse("simGetDetections");
}

}  // namespace tileflight::simulator
