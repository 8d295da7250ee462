#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "tileflight/capture/vehicle/vehicle_plan.h"
#include "tileflight/core/base/strict_section.h"

namespace tileflight::vehicle {

/// Vision input of an autopilot (key `vision`), and the camera of its own from whose pictures it is made.
struct VisionPlan {
  enum class Source { kNone, kTruth, kOdometry, kPlace };
  Source source = Source::kNone;
  std::string tiles;  ///< of kPlace: SOURCE of the tiles that pictures are located in; empty: those that are flown over
  double rate_hz = 15.0, latency_s = 0.1;
  int width = 320, height = 240;
  double fov_deg = 100.0;                            ///< of the longer side
  double pitch_deg = -90.0;                          ///< fixed to the body; -90: down
  geometry::Vec3 offset_m = geometry::Vec3::Zero();  ///< from the centre of mass: forward, left, up
};

/// The autopilot settings of a FLIGHT file: a program that flies the vehicle by the interface that ArduPilot or PX4 has
/// for simulators, with a mission of its own (docs/autopilots.md).
struct AutopilotPlan {
  bool is_px4 = false;           ///< else ArduPilot
  std::string command;           ///< starts it, with {port}, {home} and {address}; empty: it connects by itself
  std::filesystem::path folder;  ///< of the file: the command runs there
  int port = 0;                  ///< 0: any free one
  bool hexarotor = false;        ///< else quadrotor
  std::optional<double> thrust_expo;
  geometry::Vec3 start_m = geometry::Vec3::Zero();   ///< local frame; it stands on the surface there
  double start_heading_deg = 0.0;                    ///< clockwise from north
  geometry::Vec3 wind_m_s = geometry::Vec3::Zero();  ///< velocity of the air: east, north, up
  CameraMount mount;
  bool gnss = true;  ///< whether it has a receiver (PX4; ArduPilot sees the true state)
  VisionPlan vision;
  double duration_s = 600.0;        ///< simulated: the flight ends then, if it has not landed before
  double connect_timeout_s = 60.0;  ///< wall clock, from the start to the first step
  double silence_s = 30.0;          ///< wall clock, between steps
};

/// Reads `autopilot:`. Keys: kind, command, port, model, thrust_expo, start, start_heading_deg, wind_m_s, mount,
/// pitch_deg, offset_m, duration_s, connect_timeout_s, silence_s, gnss, vision. Throws InputError (file, line, key).
AutopilotPlan read_autopilot_plan(base::StrictSection& section, const std::filesystem::path& file);

}  // namespace tileflight::vehicle
