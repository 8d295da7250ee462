#include <cmath>
#include <limits>
#include <stdexcept>

#include "tileflight/live/simulator/segmentation_ids.h"
#include "tileflight/capture/sensors/barometer.h"
#include "tileflight/live/simulator/echo_sensor.h"
#include "tileflight/live/simulator/frames.h"
#include "tileflight/live/simulator/simulator_impl.h"

namespace tileflight::simulator {
namespace {

using geometry::SE3;
using geometry::Vec3;

constexpr double kGasConstant = 287.053;  // of dry air, J / (kg K)

/// The sensor of this kind and name, or the first of its kind for an empty name. Errors use AirSim's wording.
template <class Kind>
const SensorSettings& find_sensor(const SimVehicle& sim_vehicle, const std::string& name, const char* kind) {
  for (const SensorSettings& sensor : sim_vehicle.settings().sensors) {
    if (std::holds_alternative<Kind>(sensor.kind) && (name.empty() || sensor.name == name)) return sensor;
  }
  throw std::runtime_error("No " + std::string(kind) + " with name " + name.substr(0, 100) + " exist on vehicle");
}

SensorNoiseState& find_noise_state(VehicleSlot& one, const std::string& sensor) {
  const auto [at, is_new] = one.sensor_noises.try_emplace(sensor);
  if (is_new) at->second.seed = sensor_seed(one.vehicle->name(), sensor);
  return at->second;
}

SensorContext make_sensor_context(const Simulator::Impl& impl, const VehicleSlot& one) {
  const SimVehicle& sim_vehicle = *one.vehicle;
  return {sim_vehicle,         one.history,          impl.geodetic_frame,
          impl.clock.time_s(), impl.clock.time_ns(), sim_vehicle.is_flying()};
}

Pose to_local_ned_pose(const SimVehicle& sim_vehicle, SE3 T_ned) {
  T_ned.translation -= sim_vehicle.start_ned();
  return to_airsim(T_ned);
}

/// A scan, with the data needed to return it to a client.
struct LidarCapture {
  LidarSettings settings;
  SE3 T_ned_sensor;
  Vec3 start_ned = Vec3::Zero();
  std::uint64_t time_ns = 0;
  std::vector<LidarReturn> returns;
  std::vector<int> segmentation_ids;  ///< by object

  /// A point in the frame chosen by the settings.
  Vector3r point(const LidarReturn& one) const {
    return to_airsim(settings.in_sensor_frame ? one.point_sensor : Vec3(T_ned_sensor * one.point_sensor - start_ned));
  }
  Pose pose() const { return to_airsim(SE3(T_ned_sensor.rotation, T_ned_sensor.translation - start_ned)); }
};

LidarCapture capture_scan(Simulator::Impl& impl, const std::string& lidar, const std::string& vehicle) {
  LidarCapture taken;
  std::vector<SensorViewpoint> viewpoints;
  {
    const std::lock_guard lock(impl.state_mutex);
    const SimVehicle& sim_vehicle = *impl.slot(vehicle).vehicle;
    taken.settings = std::get<LidarSettings>(find_sensor<LidarSettings>(sim_vehicle, lidar, "lidar").kind);
    taken.T_ned_sensor = sim_vehicle.state().T_ned_body * taken.settings.T_body_sensor;
    taken.start_ned = sim_vehicle.start_ned();
    taken.time_ns = impl.clock.time_ns();
    viewpoints = impl.viewpoints();
  }
  const auto place = impl.place_for(viewpoints);
  taken.returns = scan_lidar(*place, taken.settings, impl.T_local_ned * taken.T_ned_sensor);
  taken.segmentation_ids = impl.segmentation_ids.lookup(place->object_names());
  return taken;
}

}  // namespace

LidarData Simulator::get_lidar_data(const std::string& lidar, const std::string& vehicle) {
  const LidarCapture taken = capture_scan(*impl_, lidar, vehicle);
  LidarData data;
  data.time_stamp = taken.time_ns;
  data.pose = taken.pose();
  data.point_cloud.reserve(3 * taken.returns.size());
  for (const LidarReturn& one : taken.returns) {
    const Vector3r p = taken.point(one);
    data.point_cloud.insert(data.point_cloud.end(), {p.x_val, p.y_val, p.z_val});
    data.segmentation.push_back(taken.segmentation_ids[one.object]);
  }
  return data;
}

GPULidarData Simulator::get_gpu_lidar_data(const std::string& lidar, const std::string& vehicle) {
  const LidarCapture taken = capture_scan(*impl_, lidar, vehicle);
  GPULidarData data;
  data.time_stamp = taken.time_ns;
  data.pose = to_airsim(taken.settings.T_body_sensor);
  data.point_cloud.reserve(5 * taken.returns.size());
  for (const LidarReturn& one : taken.returns) {
    const Vector3r p = taken.point(one);
    // 24 bits: exact in a float.
    const auto colour =
        static_cast<float>(simulator::colour_number(simulator::segmentation_colour(taken.segmentation_ids[one.object])));
    data.point_cloud.insert(data.point_cloud.end(), {p.x_val, p.y_val, p.z_val, colour, one.intensity});
  }
  return data;
}

EchoData Simulator::get_echo_data(const std::string& echo, const std::string& vehicle) {
  EchoData data;
  EchoSettings settings;
  SE3 T_local_sensor;
  std::vector<SensorViewpoint> viewpoints;
  {
    const std::lock_guard lock(impl_->state_mutex);
    const SimVehicle& sim_vehicle = *impl_->slot(vehicle).vehicle;
    settings = std::get<EchoSettings>(find_sensor<EchoSettings>(sim_vehicle, echo, "echo").kind);
    T_local_sensor = impl_->T_local_ned * sim_vehicle.state().T_ned_body * settings.T_body_sensor;
    data.time_stamp = impl_->clock.time_ns();
    viewpoints = impl_->viewpoints();
  }
  const auto place = impl_->place_for(viewpoints);
  data.pose = to_airsim(settings.T_body_sensor);
  for (const EchoReturn& one : sense_echoes(*place, settings, T_local_sensor)) {
    const Vector3r p = to_airsim(one.point_sensor);
    data.point_cloud.insert(data.point_cloud.end(),
                            {p.x_val, p.y_val, p.z_val, static_cast<float>(one.attenuation_db),
                             static_cast<float>(one.distance_m), static_cast<float>(one.reflections)});
    data.groundtruth.push_back(place->object_names()[one.object]);
  }
  return data;
}

LidarScanData Simulator::tf_lidar_scan(const std::string& lidar, const std::string& vehicle) {
  const LidarCapture taken = capture_scan(*impl_, lidar, vehicle);
  LidarScanData data;
  data.time_stamp = taken.time_ns;
  data.pose = taken.pose();
  for (const LidarReturn& one : taken.returns) {
    const Vector3r p = taken.point(one);
    data.point_cloud.insert(data.point_cloud.end(), {p.x_val, p.y_val, p.z_val});
    data.intensity.push_back(one.intensity);
    data.ring.push_back(one.ring);
    data.time_offset.push_back(one.time_offset_s);
    data.segmentation.push_back(taken.segmentation_ids[one.object]);
  }
  return data;
}

ImuData Simulator::get_imu_data(const std::string& imu, const std::string& vehicle) {
  const std::lock_guard lock(impl_->state_mutex);
  VehicleSlot& one = impl_->slot(vehicle);
  const SensorSettings& sensor = find_sensor<ImuSettings>(*one.vehicle, imu, "IMU");
  return read_imu(std::get<ImuSettings>(sensor.kind), make_sensor_context(*impl_, one),
                  find_noise_state(one, sensor.name));
}

BarometerData Simulator::get_barometer_data(const std::string& barometer, const std::string& vehicle) {
  const std::lock_guard lock(impl_->state_mutex);
  VehicleSlot& one = impl_->slot(vehicle);
  const SensorSettings& sensor = find_sensor<BarometerSettings>(*one.vehicle, barometer, "barometer");
  return read_barometer(std::get<BarometerSettings>(sensor.kind), make_sensor_context(*impl_, one),
                        find_noise_state(one, sensor.name));
}

MagnetometerData Simulator::get_magnetometer_data(const std::string& magnetometer, const std::string& vehicle) {
  const std::lock_guard lock(impl_->state_mutex);
  VehicleSlot& one = impl_->slot(vehicle);
  const SensorSettings& sensor = find_sensor<MagnetometerSettings>(*one.vehicle, magnetometer, "magnetometer");
  return read_magnetometer(std::get<MagnetometerSettings>(sensor.kind), make_sensor_context(*impl_, one),
                           find_noise_state(one, sensor.name));
}

GpsData Simulator::get_gps_data(const std::string& gps, const std::string& vehicle) {
  const std::lock_guard lock(impl_->state_mutex);
  VehicleSlot& one = impl_->slot(vehicle);
  const SensorSettings& sensor = find_sensor<GpsSettings>(*one.vehicle, gps, "gps");
  return read_gps(std::get<GpsSettings>(sensor.kind), make_sensor_context(*impl_, one),
                  find_noise_state(one, sensor.name));
}

DistanceSensorData Simulator::get_distance_sensor_data(const std::string& distance_sensor, const std::string& vehicle) {
  std::vector<SensorViewpoint> viewpoints;
  {
    const std::lock_guard lock(impl_->state_mutex);
    viewpoints = impl_->viewpoints();
  }
  const auto place = impl_->place_for(viewpoints);
  const std::lock_guard lock(impl_->state_mutex);
  VehicleSlot& one = impl_->slot(vehicle);
  const SensorSettings& sensor = find_sensor<DistanceSensorSettings>(*one.vehicle, distance_sensor, "distance sensor");
  const auto& settings = std::get<DistanceSensorSettings>(sensor.kind);
  const SE3 T_local_sensor = impl_->T_local_ned * one.vehicle->state().T_ned_body * settings.T_body_sensor;
  const Vec3 forward = T_local_sensor.rotation * Vec3::UnitX();
  const auto hit = place->scene().intersect({T_local_sensor.translation, forward}, settings.max_m);
  const double distance_m = hit ? hit->distance_m : std::numeric_limits<double>::infinity();
  return read_distance(settings, make_sensor_context(*impl_, one), distance_m, find_noise_state(one, sensor.name));
}

namespace {

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

CollisionInfo to_collision_info(const Simulator::Impl& impl, const SimVehicle& sim_vehicle) {
  const VehicleCollision& last = sim_vehicle.collision();
  CollisionInfo info;
  info.has_collided = last.unread;
  if (last.time_s <= 0.0 && !last.unread) return info;
  info.penetration_depth = static_cast<float>(last.depth_m);
  info.time_stamp = impl.clock.time_ns() - static_cast<std::uint64_t>((impl.clock.time_s() - last.time_s) * 1e9);
  info.normal = to_airsim(last.normal_ned);
  info.impact_point = to_airsim(Vec3(last.point_ned - sim_vehicle.start_ned()));
  info.position = to_airsim(Vec3(last.position_ned - sim_vehicle.start_ned()));
  info.object_name = last.object.empty() ? "surface" : last.object;
  info.object_id = 0;
  return info;
}

}  // namespace

KinematicsState Simulator::sim_get_ground_truth_kinematics(const std::string& vehicle) const {
  const std::lock_guard lock(impl_->state_mutex);
  return to_kinematics_state(*impl_->slot(vehicle).vehicle);
}

/// A flying vehicle continues from rest at its next command.
void Simulator::sim_set_kinematics(const KinematicsState& state, bool /*ignore_collision*/,
                                   const std::string& vehicle) {
  const char* call = "simSetKinematics";
  const std::lock_guard lock(impl_->state_mutex);
  SimVehicle& sim_vehicle = *impl_->slot(vehicle).vehicle;
  VehicleState target;
  target.T_ned_body = {checked_rotation(state.orientation, call),
                       checked_position(state.position, call) + sim_vehicle.start_ned()};
  target.velocity_m_s = checked_position(state.linear_velocity, call);
  target.angular_velocity_rad_s = checked_position(state.angular_velocity, call);
  target.acceleration_m_s2 = checked_position(state.linear_acceleration, call);
  target.angular_acceleration_rad_s2 = checked_position(state.angular_acceleration, call);
  sim_vehicle.teleport(target);
  impl_->clock.wake();
}

ComputerVisionState Simulator::get_computer_vision_state(const std::string& vehicle) const {
  const std::lock_guard lock(impl_->state_mutex);
  return {to_kinematics_state(*impl_->slot(vehicle).vehicle), impl_->clock.time_ns()};
}

EnvironmentState Simulator::sim_get_ground_truth_environment(const std::string& vehicle) const {
  const std::lock_guard lock(impl_->state_mutex);
  const SimVehicle& sim_vehicle = *impl_->slot(vehicle).vehicle;
  const Vec3 position = sim_vehicle.state().T_ned_body.translation;
  const sensors::Atmosphere air;
  const double height_m = clamp_atmosphere_height_m(impl_->geodetic_frame.to_geodetic(position).height.m);
  EnvironmentState state;
  state.position = to_airsim(Vec3(position - sim_vehicle.start_ned()));
  state.geo_point = impl_->geodetic_frame.to_geo_point(position);
  state.gravity = {0.0F, 0.0F, static_cast<float>(vehicle::kStandardGravity_m_s2)};
  state.air_pressure = static_cast<float>(air.pressure_pa(height_m));
  state.temperature = static_cast<float>(air.temperature_k(height_m));
  state.air_density = static_cast<float>(air.pressure_pa(height_m) / (kGasConstant * air.temperature_k(height_m)));
  return state;
}

CollisionInfo Simulator::sim_get_collision_info(const std::string& vehicle) {
  const std::lock_guard lock(impl_->state_mutex);
  SimVehicle& sim_vehicle = *impl_->slot(vehicle).vehicle;
  const CollisionInfo info = to_collision_info(*impl_, sim_vehicle);
  sim_vehicle.collision().unread = false;
  return info;
}

MultirotorState Simulator::get_multirotor_state(const std::string& vehicle) const {
  const std::lock_guard lock(impl_->state_mutex);
  const SimVehicle& sim_vehicle = *impl_->slot(vehicle).vehicle;
  MultirotorState state;
  state.collision = to_collision_info(*impl_, sim_vehicle);
  state.kinematics_estimated = to_kinematics_state(sim_vehicle);
  state.gps_location = impl_->geodetic_frame.to_geo_point(sim_vehicle.state().T_ned_body.translation);
  state.timestamp = impl_->clock.time_ns();
  state.landed_state = sim_vehicle.landed() ? 0 : 1;
  return state;
}

RotorStates Simulator::get_rotor_states(const std::string& vehicle) const {
  const std::lock_guard lock(impl_->state_mutex);
  const SimVehicle& sim_vehicle = impl_->require_multirotor(vehicle, "getRotorStates");
  const vehicle::MultirotorOptions& options = sim_vehicle.options().quadrotor;
  const std::vector<vehicle::Rotor> rotors = sim_vehicle.rotors();
  const std::vector<double> speeds = sim_vehicle.rotor_speeds_rad_s();
  RotorStates states;
  states.timestamp = impl_->clock.time_ns();
  for (std::size_t i = 0; i < rotors.size(); ++i) {
    const double squared = speeds[i] * speeds[i];
    const double spin = rotors[i].spin;
    states.rotors.push_back({static_cast<float>(options.thrust_n_s2 * squared),
                             static_cast<float>(-spin * options.torque_nm_s2 * squared),
                             static_cast<float>(spin * speeds[i])});
  }
  return states;
}

GeoPoint Simulator::get_home_geo_point(const std::string& vehicle) const {
  const std::lock_guard lock(impl_->state_mutex);
  return impl_->geodetic_frame.to_geo_point(impl_->slot(vehicle).vehicle->home().translation);
}

GeodeticPose Simulator::tf_geodetic_pose(const std::string& vehicle) const {
  const std::lock_guard lock(impl_->state_mutex);
  const SimVehicle& sim_vehicle = *impl_->slot(vehicle).vehicle;
  const SE3& T = sim_vehicle.state().T_ned_body;
  GeodeticPose pose;
  pose.geo_point = impl_->geodetic_frame.to_geo_point(T.translation);
  pose.altitude = impl_->geodetic_frame.to_geodetic(T.translation).height.m;
  pose.heading = static_cast<float>(std::fmod(degrees(heading_rad(T.rotation)) + 360.0, 360.0));
  pose.orientation = to_airsim(T.rotation);
  pose.time_stamp = impl_->clock.time_ns();
  pose.georeferenced = impl_->geodetic_frame.georeferenced;
  return pose;
}

}  // namespace tileflight::simulator
