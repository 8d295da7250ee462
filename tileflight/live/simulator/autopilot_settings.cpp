#include "tileflight/live/simulator/autopilot_settings.h"

#include <vector>

namespace tileflight::simulator {
namespace {

constexpr double kArduPilotExpo = 0.65, kPx4Expo = 0.0;  // MOT_THST_EXPO, THR_MDL_FAC

/// AirSim's keys of PX4 for what is not here: a serial port, its offboard control, its ground station and log viewer.
const std::vector<std::string> kIgnoredOfPx4{
    "ControlIp",      "ControlPort",     "ControlPortLocal", "ControlPortRemote",
    "LocalHostIp",    "UdpIp",           "UdpPort",          "QgcHostIp",
    "QgcPort",        "SitlIp",          "SitlPort",         "SerialPort",
    "SerialBaudRate", "LogViewerHostIp", "LogViewerPort",    "LogViewerSendPort",
    "SimSysID",       "SimCompID",       "AirControlSysID",  "AirControlCompID",
    "OffboardSysID",  "OffboardCompID",  "ExternalSimSysID", "ExternalSimPort"};

vehicle::AirframeKind read_airframe(base::StrictSection& vehicle) {
  const std::string model =
      vehicle.choice_in_any_case("Model", {"Generic", "Quadcopter", "Hexacopter"}).value_or("Generic");
  return model == "Hexacopter" ? vehicle::AirframeKind::kHexaX : vehicle::AirframeKind::kQuadX;
}

VisionSettings read_vision(base::StrictSection& vehicle) {
  VisionSettings vision;
  const std::string source =
      vehicle.choice_in_any_case("VisionOdometry", {"None", "TruthWithNoise", "FromPictures"}).value_or("None");
  vision.source = source == "TruthWithNoise" ? VisionSource::kTruth
                  : source == "FromPictures" ? VisionSource::kPictures
                                             : VisionSource::kNone;
  vision.camera = vehicle.text("VisionCamera").value_or(vision.camera);
  vision.rate_hz = vehicle.number("VisionRate", vision.rate_hz, 1.0, 125.0);
  vision.latency_s = vehicle.number("VisionLatency", vision.latency_s, 0.0, 1.0);
  return vision;
}

AutopilotSettings read_px4(base::StrictSection& vehicle) {
  AutopilotSettings settings{.kind = AutopilotKind::kPx4};
  if (vehicle.boolean("UseSerial").value_or(false))
    throw vehicle.error("UseSerial", "PX4 is served over TCP; set it to false");
  if (!vehicle.boolean("UseTcp").value_or(true))
    throw vehicle.error("UseTcp", "PX4 is served over TCP; set it to true");
  settings.port = vehicle.integer("TcpPort", 4560, 0, 65535);
  settings.lockstep = vehicle.boolean("LockStep").value_or(true);
  settings.thrust_expo = vehicle.number("ThrustExpo", kPx4Expo, 0.0, 1.0);
  settings.optical_flow = vehicle.boolean("OpticalFlow").value_or(false);
  settings.vision = read_vision(vehicle);
  vehicle.ignore(kIgnoredOfPx4);
  return settings;
}

AutopilotSettings read_ardupilot(base::StrictSection& vehicle) {
  AutopilotSettings settings;
  settings.port = vehicle.integer("ControlPort", 9002, 0, 65535);
  settings.thrust_expo = vehicle.number("ThrustExpo", kArduPilotExpo, 0.0, 1.0);
  if (vehicle.has("VisionOdometry"))
    throw vehicle.error("VisionOdometry",
                        "ArduPilot's JSON interface has no message for it: ArduPilot takes vision over "
                        "a serial port of its own (docs/autopilots.md)");
  // The state goes back to where the servo packets come from.
  vehicle.ignore({"UdpIp", "UdpPort", "LocalHostIp", "UseSerial"});
  return settings;
}

}  // namespace

std::optional<AutopilotSettings> read_autopilot(const std::string& vehicle_type, base::StrictSection& vehicle) {
  if (vehicle_type != "ArduCopter" && vehicle_type != "PX4Multirotor") return std::nullopt;
  AutopilotSettings settings = vehicle_type == "ArduCopter" ? read_ardupilot(vehicle) : read_px4(vehicle);
  settings.airframe = read_airframe(vehicle);
  return settings;
}

}  // namespace tileflight::simulator
