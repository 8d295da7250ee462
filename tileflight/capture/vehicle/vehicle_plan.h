#pragma once

#include <string>
#include <vector>

#include "tileflight/capture/vehicle/vehicle.h"
#include "tileflight/core/base/strict_section.h"

namespace tileflight::vehicle {

/// Mounting of the camera.
struct CameraMount {
  /// Stabilized: keeps pitch and roll whatever the body does, and turns with its yaw. Otherwise fixed to the body.
  bool gimbal = true;
  /// Pitch of the optical axis: above the body's x axis (fixed), or above the horizon in a mission (gimbal). In a
  /// flight through waypoints a gimbal uses theirs.
  double pitch_deg = 0.0;
  geometry::Vec3 offset_m = geometry::Vec3::Zero();  ///< of the camera from the centre of mass: forward, left, up
};

/// A mission's command and its keyword in the file.
struct MissionStep {
  std::string name;
  Command command;
};

/// The vehicle settings of a FLIGHT file.
struct VehiclePlan {
  VehicleOptions options{.collision = CollisionPolicy::kOff};
  CameraMount mount;
  geometry::Vec3 start_m = geometry::Vec3::Zero();  ///< camera position at the start of a mission, local frame
  double start_yaw_rad = 0.0;                       ///< yaw at the start of a mission
  bool landed = false;                              ///< a mission starts with the rotors off
};

/// Reads the keys mount, pitch_deg, offset_m. Throws InputError (file, line, key).
CameraMount read_mount(base::StrictSection& section);

/// Reads `vehicle:`. Keys: wind_m_s, turbulence, height_above_ground_m, seed, collision, restitution, friction,
/// radius_m, mount, pitch_deg, offset_m, start, start_heading_deg, landed, mass_kg, linear_drag, quadratic_drag,
/// max_tilt_deg. Throws InputError (file, line, key).
VehiclePlan read_vehicle(base::StrictSection& section);

/// Reads `mission:`, a list of commands `{do: WORD, ...}`: takeoff, land, hover, go_to, path, velocity, turn,
/// turn_rate. docs/vehicles.md lists their keys. Throws InputError (file, line, key).
std::vector<MissionStep> read_mission(base::StrictSection& plan);

/// Returns the outcome in words: "finished", "timed out", "cancelled", "collided", "running".
std::string outcome_text(Outcome outcome);

}  // namespace tileflight::vehicle
