#include "tileflight/simulator/autopilot_settings.h"

namespace tileflight::simulator {
namespace {

constexpr double kArduPilotExpo = 0.65;  // MOT_THST_EXPO

autopilot::AirframeKind read_airframe(base::StrictSection& vehicle) {
  const std::string model =
      vehicle.choice_in_any_case("Model", {"Generic", "Quadcopter", "Hexacopter"}).value_or("Generic");
  return model == "Hexacopter" ? autopilot::AirframeKind::kHexaX : autopilot::AirframeKind::kQuadX;
}

}  // namespace

std::optional<AutopilotSettings> read_autopilot(const std::string& vehicle_type, base::StrictSection& vehicle) {
  if (vehicle_type != "ArduCopter") return std::nullopt;
  AutopilotSettings settings;
  settings.port = vehicle.integer("ControlPort", 9002, 0, 65535);
  settings.airframe = read_airframe(vehicle);
  settings.thrust_expo = vehicle.number("ThrustExpo", kArduPilotExpo, 0.0, 1.0);
  // The state goes back to where the servo packets come from.
  vehicle.ignore({"UdpIp", "UdpPort", "LocalHostIp", "UseSerial"});
  return settings;
}

}  // namespace tileflight::simulator
