#pragma once

#include <string>
#include <vector>

#include "tileflight/live/simulator/airsim_types.h"

namespace tileflight::simulator {

struct World;

/// The vehicles: control over them, and their poses and states. Positions are metres in a vehicle's own NED, which has
/// its origin at the vehicle's start.
class Vehicles {
 public:
  explicit Vehicles(World& world) : world_(world) {}

  /// Lets clients control the vehicle, or ends that.
  void enable_api_control(bool is_enabled, const std::string& vehicle);
  bool is_api_control_enabled(const std::string& vehicle) const;
  /// Arms or disarms a vehicle. Returns false and changes nothing without API control, as AirSim does, and when asked
  /// to disarm a vehicle in the air.
  bool arm_disarm(bool arm, const std::string& vehicle);
  /// Returns the start position.
  GeoPoint get_home_geo_point(const std::string& vehicle) const;
  std::vector<std::string> list_vehicles() const;
  /// Adds a vehicle of the type SimpleFlight or ComputerVision with the default cameras and sensors. Returns false if
  /// the name is taken or the type does not suit the settings' SimMode. Throws InputError for an unknown type, an
  /// unusable name or pose, or more than kMaxVehicles vehicles.
  bool add_vehicle(const std::string& name, const std::string& type, const Pose& pose, const std::string& pawn_path);
  /// Places a vehicle at rest, where it stays until its next command. Components of the pose that are NaN keep their
  /// value. Without `ignore_collision` the vehicle moves there in a straight line until it meets an obstacle.
  void set_vehicle_pose(const Pose& pose, bool ignore_collision, const std::string& vehicle);
  Pose get_vehicle_pose(const std::string& vehicle) const;
  KinematicsState get_ground_truth_kinematics(const std::string& vehicle) const;
  /// Places a vehicle with these velocities and accelerations; a vehicle that flies continues from rest at its next
  /// command.
  void set_kinematics(const KinematicsState& state, bool ignore_collision, const std::string& vehicle);
  EnvironmentState get_ground_truth_environment(const std::string& vehicle) const;
  /// Returns the latest collision and marks it as read.
  CollisionInfo get_collision_info(const std::string& vehicle);
  MultirotorState get_multirotor_state(const std::string& vehicle) const;
  /// Throws std::runtime_error for a vehicle that does not fly.
  RotorStates get_rotor_states(const std::string& vehicle) const;
  ComputerVisionState get_computer_vision_state(const std::string& vehicle) const;
  GeodeticPose geodetic_pose(const std::string& vehicle) const;

 private:
  World& world_;
};

}  // namespace tileflight::simulator
