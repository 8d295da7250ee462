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

  void enable_api_control(bool is_enabled, const std::string& vehicle);
  bool is_api_control_enabled(const std::string& vehicle) const;
  /// False, and nothing changes: without API control (AirSim's answer), or to disarm a vehicle in the air.
  bool arm_disarm(bool arm, const std::string& vehicle);
  GeoPoint get_home_geo_point(const std::string& vehicle) const;
  std::vector<std::string> list_vehicles() const;
  bool add_vehicle(const std::string& name, const std::string& type, const Pose& pose, const std::string& pawn_path);
  void set_vehicle_pose(const Pose& pose, bool ignore_collision, const std::string& vehicle);
  Pose get_vehicle_pose(const std::string& vehicle) const;
  KinematicsState get_ground_truth_kinematics(const std::string& vehicle) const;
  void set_kinematics(const KinematicsState& state, bool ignore_collision, const std::string& vehicle);
  EnvironmentState get_ground_truth_environment(const std::string& vehicle) const;
  CollisionInfo get_collision_info(const std::string& vehicle);
  MultirotorState get_multirotor_state(const std::string& vehicle) const;
  RotorStates get_rotor_states(const std::string& vehicle) const;
  ComputerVisionState get_computer_vision_state(const std::string& vehicle) const;
  GeodeticPose geodetic_pose(const std::string& vehicle) const;

 private:
  World& world_;
};

}  // namespace tileflight::simulator
