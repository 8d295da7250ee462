#pragma once

#include <optional>
#include <string>

#include "tileflight/capture/vehicle/airframe.h"
#include "tileflight/core/base/strict_section.h"

namespace tileflight::simulator {

/// The interfaces of autopilots that fly vehicles.
enum class AutopilotKind {
  kArduPilot,  ///< VehicleType ArduCopter: ArduPilot's JSON interface, UDP
  kPx4,        ///< VehicleType PX4Multirotor: PX4's simulator interface, MAVLink over TCP
};

/// Source of an autopilot's vision input, the message ODOMETRY.
enum class VisionSource {
  kNone,
  kTruth,     ///< the true pose and velocity with white noise
  kPictures,  ///< the built-in odometry, on a camera's pictures and the inertial unit's readings
};

struct VisionSettings {
  VisionSource source = VisionSource::kNone;
  // Of kPictures:
  std::string camera = "bottom_center";  ///< of the vehicle
  double rate_hz = 15.0;                 ///< of its pictures; rounded to whole steps of the autopilot between them
  double latency_s = 0.1;                ///< from the exposure to the message
};

/// An autopilot that flies a vehicle: its port, and its vehicle.
struct AutopilotSettings {
  AutopilotKind kind = AutopilotKind::kArduPilot;
  int port = 9002;       ///< ControlPort or TcpPort, on which the simulator listens; 0: any free port
  bool lockstep = true;  ///< of PX4: LockStep
  vehicle::AirframeKind airframe = vehicle::AirframeKind::kQuadX;
  bool optical_flow = false;  ///< of PX4: own key OpticalFlow, sends HIL_OPTICAL_FLOW
  VisionSettings vision;      ///< of PX4: own keys VisionOdometry, VisionCamera, VisionRate, VisionLatency
  double thrust_expo = 0.65;  ///< of the motors: own key ThrustExpo; default as of the autopilot's parameters
};

/// Reads a vehicle's autopilot keys; nullopt for a VehicleType without an autopilot. Throws InputError.
std::optional<AutopilotSettings> read_autopilot(const std::string& vehicle_type, base::StrictSection& vehicle);

}  // namespace tileflight::simulator
