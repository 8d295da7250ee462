#pragma once

#include <string>
#include <vector>

#include "tileflight/flight/vehicle.h"
#include "tileflight/geometry/yaml_section.h"

namespace tileflight::flight {

/// How the camera is held.
struct CameraMount {
  /// Stabilised: it keeps pitch and roll whatever the craft does and turns with the craft's yaw. Else fixed to the
  /// body.
  bool gimbal = true;
  /// Of the axis above the body's x axis (fixed), or above the horizon in a mission (gimbal); a gimbal in a flight
  /// through waypoints has theirs.
  double pitch_deg = 0.0;
  geometry::Vec3 offset_m = geometry::Vec3::Zero();  ///< of the camera from the centre of mass: forward, left, up
};

/// A command of a mission under the word that the file has for it.
struct MissionStep {
  std::string name;
  Command command;
};

/// What of a FLIGHT file is about its vehicle.
struct VehiclePlan {
  VehicleOptions options{.collision = CollisionPolicy::kOff};
  CameraMount mount;
  geometry::Vec3 start_m = geometry::Vec3::Zero();  ///< of a mission: the camera's, local frame
  double start_yaw_rad = 0.0;                       ///< of a mission
  bool landed = false;                              ///< a mission begins with the rotors off
};

/// `vehicle:` Keys: wind_m_s, turbulence, height_above_ground_m, seed, collision, restitution, friction, radius_m,
/// mount, pitch_deg, offset_m, start, start_heading_deg, landed, mass_kg, linear_drag, quadratic_drag, max_tilt_deg.
/// Throws InputError (file, line, key).
VehiclePlan read_vehicle(geometry::YamlSection& section);

/// `mission:` a list of commands, each `{do: WORD, ...}`: takeoff, land, hover, go_to, path, velocity, turn, turn_rate.
/// docs/vehicles.md has their keys. Throws InputError (file, line, key).
std::vector<MissionStep> read_mission(geometry::YamlSection& plan);

/// "finished", "timed out", "cancelled", "collided", "running".
std::string outcome_text(Outcome outcome);

}  // namespace tileflight::flight
