#include "tileflight/live/simulator/vehicles.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "tileflight/capture/sensors/barometer.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/live/simulator/frames.h"
#include "tileflight/live/simulator/world.h"

namespace tileflight::simulator {
namespace {

using geometry::SE3;
using geometry::Vec3;

constexpr std::size_t kMaxVehicleName = 100;
constexpr double kGasConstant = 287.053;  // of dry air, J / (kg K)

Pose to_local_ned_pose(const SimVehicle& sim_vehicle, SE3 T_ned) {
  T_ned.translation -= sim_vehicle.start_ned();
  return to_airsim(T_ned);
}

KinematicsState to_kinematics_state(const SimVehicle& sim_vehicle) {
  const VehicleState& state = sim_vehicle.state();
  const Pose pose = to_local_ned_pose(sim_vehicle, state.T_ned_body);
  return {pose.position,
          pose.orientation,
          to_airsim(state.velocity_m_s),
          to_airsim(state.angular_velocity_rad_s),
          to_airsim(state.acceleration_m_s2),
          to_airsim(state.angular_acceleration_rad_s2)};
}

CollisionInfo to_collision_info(const World& world, const SimVehicle& sim_vehicle) {
  const VehicleCollision& last = sim_vehicle.collision();
  CollisionInfo info;
  info.has_collided = last.unread;
  if (last.time_s <= 0.0 && !last.unread) return info;
  info.penetration_depth = static_cast<float>(last.depth_m);
  info.time_stamp = world.clock.time_ns() - static_cast<std::uint64_t>((world.clock.time_s() - last.time_s) * 1e9);
  info.normal = to_airsim(last.normal_ned);
  info.impact_point = to_airsim(Vec3(last.point_ned - sim_vehicle.start_ned()));
  info.position = to_airsim(Vec3(last.position_ned - sim_vehicle.start_ned()));
  info.object_name = last.object.empty() ? "surface" : last.object;
  info.object_id = 0;
  return info;
}

}  // namespace

std::vector<std::string> Vehicles::list_vehicles() const {
  const std::lock_guard lock(world_.state_mutex);
  std::vector<std::string> names;
  for (const auto& one : world_.vehicles) names.push_back(one->vehicle->name());
  return names;
}

bool Vehicles::add_vehicle(const std::string& name, const std::string& type, const Pose& pose,
                           const std::string& /*pawn_path*/) {
  const bool flies = type == "SimpleFlight" || type == "simpleflight";
  if (!flies && type != "ComputerVision" && type != "computervision")
    throw InputError("simAddVehicle",
                     "the type '" + type.substr(0, kMaxVehicleName) + "' must be SimpleFlight or ComputerVision");
  if (flies == world_.settings.computer_vision) return false;  // as AirSim: vehicles of the other mode are rejected
  if (name.empty() || name.size() > kMaxVehicleName) throw InputError("simAddVehicle", "the name is empty or too long");
  VehicleSettings vehicle = default_vehicle(name, flies, world_.settings.camera_defaults);
  vehicle.start_ned = checked_position(pose.position, "simAddVehicle");
  vehicle.R_ned_body = checked_rotation(pose.orientation, "simAddVehicle");
  const geometry::SE3 home = world_.find_home_pose(vehicle);
  const std::lock_guard lock(world_.state_mutex);
  if (world_.vehicles.size() >= kMaxVehicles)
    throw InputError("simAddVehicle", "there are " + std::to_string(kMaxVehicles) + " vehicles already");
  const bool known =
      std::ranges::any_of(world_.vehicles, [&](const auto& one) { return one->vehicle->name() == name; });
  if (known) return false;
  world_.add_vehicle(std::move(vehicle), home);
  return true;
}

void Vehicles::enable_api_control(bool is_enabled, const std::string& vehicle) {
  const std::lock_guard lock(world_.state_mutex);
  world_.slot(vehicle).vehicle->api_control = is_enabled;
}

bool Vehicles::is_api_control_enabled(const std::string& vehicle) const {
  const std::lock_guard lock(world_.state_mutex);
  return world_.slot(vehicle).vehicle->api_control;
}

bool Vehicles::arm_disarm(bool arm, const std::string& vehicle) {
  const std::lock_guard lock(world_.state_mutex);
  SimVehicle& sim_vehicle = *world_.slot(vehicle).vehicle;
  if (!sim_vehicle.settings().flies) return true;
  if (!sim_vehicle.api_control && !sim_vehicle.settings().allow_api_always) {
    world_.log_line("armDisarm: ignored, '" + sim_vehicle.name() + "' is not under API control (enableApiControl)");
    return false;
  }
  if (!arm && !sim_vehicle.landed()) {
    world_.log_line("armDisarm: '" + sim_vehicle.name() + "' is in the air and stays armed; land first");
    return false;
  }
  sim_vehicle.armed = arm;
  return true;
}

/// A flying vehicle is placed as well, and stays there until its next command.
void Vehicles::set_vehicle_pose(const Pose& pose, bool ignore_collision, const std::string& vehicle) {
  const std::lock_guard lock(world_.state_mutex);
  SimVehicle& sim_vehicle = *world_.slot(vehicle).vehicle;
  const SE3& before = sim_vehicle.state().T_ned_body;
  const SE3 own(before.rotation, before.translation - sim_vehicle.start_ned());
  SE3 T_target = merge_pose(pose, own, "simSetVehiclePose");
  T_target.translation += sim_vehicle.start_ned();
  if (ignore_collision) {
    sim_vehicle.teleport({T_target});
  } else {
    sim_vehicle.sweep_to(T_target, world_.clock.time_s());
  }
  world_.clock.wake();
}

Pose Vehicles::get_vehicle_pose(const std::string& vehicle) const {
  const std::lock_guard lock(world_.state_mutex);
  const SimVehicle& sim_vehicle = *world_.slot(vehicle).vehicle;
  const SE3& T = sim_vehicle.state().T_ned_body;
  return to_airsim(SE3(T.rotation, T.translation - sim_vehicle.start_ned()));
}

KinematicsState Vehicles::get_ground_truth_kinematics(const std::string& vehicle) const {
  const std::lock_guard lock(world_.state_mutex);
  return to_kinematics_state(*world_.slot(vehicle).vehicle);
}

/// A flying vehicle continues from rest at its next command.
void Vehicles::set_kinematics(const KinematicsState& state, bool /*ignore_collision*/, const std::string& vehicle) {
  const char* call = "simSetKinematics";
  const std::lock_guard lock(world_.state_mutex);
  SimVehicle& sim_vehicle = *world_.slot(vehicle).vehicle;
  VehicleState target;
  target.T_ned_body = {checked_rotation(state.orientation, call),
                       checked_position(state.position, call) + sim_vehicle.start_ned()};
  target.velocity_m_s = checked_position(state.linear_velocity, call);
  target.angular_velocity_rad_s = checked_position(state.angular_velocity, call);
  target.acceleration_m_s2 = checked_position(state.linear_acceleration, call);
  target.angular_acceleration_rad_s2 = checked_position(state.angular_acceleration, call);
  sim_vehicle.teleport(target);
  world_.clock.wake();
}

ComputerVisionState Vehicles::get_computer_vision_state(const std::string& vehicle) const {
  const std::lock_guard lock(world_.state_mutex);
  return {to_kinematics_state(*world_.slot(vehicle).vehicle), world_.clock.time_ns()};
}

EnvironmentState Vehicles::get_ground_truth_environment(const std::string& vehicle) const {
  const std::lock_guard lock(world_.state_mutex);
  const SimVehicle& sim_vehicle = *world_.slot(vehicle).vehicle;
  const Vec3 position = sim_vehicle.state().T_ned_body.translation;
  const sensors::Atmosphere air;
  const double height_m = clamp_atmosphere_height_m(world_.geodetic_frame.to_geodetic(position).height.m);
  EnvironmentState state;
  state.position = to_airsim(Vec3(position - sim_vehicle.start_ned()));
  state.geo_point = world_.geodetic_frame.to_geo_point(position);
  state.gravity = {0.0F, 0.0F, static_cast<float>(vehicle::kStandardGravity_m_s2)};
  state.air_pressure = static_cast<float>(air.pressure_pa(height_m));
  state.temperature = static_cast<float>(air.temperature_k(height_m));
  state.air_density = static_cast<float>(air.pressure_pa(height_m) / (kGasConstant * air.temperature_k(height_m)));
  return state;
}

CollisionInfo Vehicles::get_collision_info(const std::string& vehicle) {
  const std::lock_guard lock(world_.state_mutex);
  SimVehicle& sim_vehicle = *world_.slot(vehicle).vehicle;
  const CollisionInfo info = to_collision_info(world_, sim_vehicle);
  sim_vehicle.collision().unread = false;
  return info;
}

MultirotorState Vehicles::get_multirotor_state(const std::string& vehicle) const {
  const std::lock_guard lock(world_.state_mutex);
  const SimVehicle& sim_vehicle = *world_.slot(vehicle).vehicle;
  MultirotorState state;
  state.collision = to_collision_info(world_, sim_vehicle);
  state.kinematics_estimated = to_kinematics_state(sim_vehicle);
  state.gps_location = world_.geodetic_frame.to_geo_point(sim_vehicle.state().T_ned_body.translation);
  state.timestamp = world_.clock.time_ns();
  state.landed_state = sim_vehicle.landed() ? 0 : 1;
  return state;
}

RotorStates Vehicles::get_rotor_states(const std::string& vehicle) const {
  const std::lock_guard lock(world_.state_mutex);
  const SimVehicle& sim_vehicle = world_.require_multirotor(vehicle, "getRotorStates");
  const vehicle::MultirotorOptions& options = sim_vehicle.options().quadrotor;
  const std::vector<vehicle::Rotor> rotors = sim_vehicle.rotors();
  const std::vector<double> speeds = sim_vehicle.rotor_speeds_rad_s();
  RotorStates states;
  states.timestamp = world_.clock.time_ns();
  for (std::size_t i = 0; i < rotors.size(); ++i) {
    const double squared = speeds[i] * speeds[i];
    const double spin = rotors[i].spin;
    states.rotors.push_back({static_cast<float>(options.thrust_n_s2 * squared),
                             static_cast<float>(-spin * options.torque_nm_s2 * squared),
                             static_cast<float>(spin * speeds[i])});
  }
  return states;
}

GeoPoint Vehicles::get_home_geo_point(const std::string& vehicle) const {
  const std::lock_guard lock(world_.state_mutex);
  return world_.geodetic_frame.to_geo_point(world_.slot(vehicle).vehicle->home().translation);
}

GeodeticPose Vehicles::geodetic_pose(const std::string& vehicle) const {
  const std::lock_guard lock(world_.state_mutex);
  const SimVehicle& sim_vehicle = *world_.slot(vehicle).vehicle;
  const SE3& T = sim_vehicle.state().T_ned_body;
  GeodeticPose pose;
  pose.geo_point = world_.geodetic_frame.to_geo_point(T.translation);
  pose.altitude = world_.geodetic_frame.to_geodetic(T.translation).height.m;
  pose.heading = static_cast<float>(std::fmod(degrees(heading_rad(T.rotation)) + 360.0, 360.0));
  pose.orientation = to_airsim(T.rotation);
  pose.time_stamp = world_.clock.time_ns();
  pose.georeferenced = world_.geodetic_frame.georeferenced;
  return pose;
}

}  // namespace tileflight::simulator
