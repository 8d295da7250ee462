#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

#include "tileflight/sensors/barometer.h"
#include "tileflight/simulator/frames.h"
#include "tileflight/simulator/simulator_impl.h"

namespace tileflight::simulator {
namespace {

using geometry::SE3;
using geometry::Vec3;

constexpr double kGasConstant = 287.053;  // of dry air, J / (kg K)

/// The sensor of that kind and name; the first of its kind for no name. AirSim's words where there is none.
template <class Kind>
const SensorSettings& sensor_of(const Craft& craft, const std::string& name, const char* kind) {
  for (const SensorSettings& sensor : craft.settings().sensors) {
    if (std::holds_alternative<Kind>(sensor.kind) && (name.empty() || sensor.name == name)) return sensor;
  }
  throw std::runtime_error("No " + std::string(kind) + " with name " + name.substr(0, 100) + " exist on vehicle");
}

/// A seed of its own for each sensor of each vehicle, the same in every run.
std::uint64_t seed_of(const std::string& vehicle, const std::string& sensor) {
  std::uint64_t seed = 1469598103934665603ULL;  // FNV-1a
  for (const char c : vehicle + "/" + sensor) seed = (seed ^ static_cast<unsigned char>(c)) * 1099511628211ULL;
  return seed;
}

SensorNoise& noise_of(Fleet& one, const std::string& sensor) {
  const auto [at, is_new] = one.noises.try_emplace(sensor);
  if (is_new) at->second.seed = seed_of(one.craft->name(), sensor);
  return at->second;
}

SensorMoment moment_of(const Simulator::Impl& impl, const Fleet& one) {
  const Craft& craft = *one.craft;
  return {craft, one.history, impl.earth, impl.engine.time_s(), impl.engine.time_ns(), craft.flying()};
}

Pose own_pose(const Craft& craft, SE3 T_ned) {
  T_ned.translation -= craft.start_ned();
  return wire(T_ned);
}

/// A scan, and what is needed to give it to a client.
struct TakenScan {
  LidarSettings settings;
  SE3 T_ned_sensor;
  Vec3 start_ned = Vec3::Zero();
  std::uint64_t time_ns = 0;
  std::vector<LidarReturn> returns;
  std::vector<int> ids;  ///< of each object

  /// A point in the frame that the settings say.
  Vector3r point(const LidarReturn& one) const {
    return wire(settings.in_sensor_frame ? one.point_sensor : Vec3(T_ned_sensor * one.point_sensor - start_ned));
  }
  Pose pose() const { return wire(SE3(T_ned_sensor.rotation, T_ned_sensor.translation - start_ned)); }
};

TakenScan take_scan(Simulator::Impl& impl, const std::string& lidar, const std::string& vehicle) {
  TakenScan taken;
  std::vector<Look> looks;
  {
    const std::lock_guard lock(impl.state);
    const Craft& craft = *impl.vehicle(vehicle).craft;
    taken.settings = std::get<LidarSettings>(sensor_of<LidarSettings>(craft, lidar, "lidar").kind);
    taken.T_ned_sensor = craft.state().T_ned_body * taken.settings.T_body_sensor;
    taken.start_ned = craft.start_ned();
    taken.time_ns = impl.engine.time_ns();
    looks = impl.looks();
  }
  const auto place = impl.world.for_looks(looks);
  taken.returns = scan(*place, taken.settings, impl.T_local_ned * taken.T_ned_sensor);
  taken.ids = impl.ids.of(place->object_names());
  return taken;
}

}  // namespace

LidarData Simulator::get_lidar_data(const std::string& lidar, const std::string& vehicle) {
  const TakenScan taken = take_scan(*impl_, lidar, vehicle);
  LidarData data;
  data.time_stamp = taken.time_ns;
  data.pose = taken.pose();
  data.point_cloud.reserve(3 * taken.returns.size());
  for (const LidarReturn& one : taken.returns) {
    const Vector3r p = taken.point(one);
    data.point_cloud.insert(data.point_cloud.end(), {p.x_val, p.y_val, p.z_val});
    data.segmentation.push_back(taken.ids[one.object]);
  }
  return data;
}

LidarScanData Simulator::tf_lidar_scan(const std::string& lidar, const std::string& vehicle) {
  const TakenScan taken = take_scan(*impl_, lidar, vehicle);
  LidarScanData data;
  data.time_stamp = taken.time_ns;
  data.pose = taken.pose();
  for (const LidarReturn& one : taken.returns) {
    const Vector3r p = taken.point(one);
    data.point_cloud.insert(data.point_cloud.end(), {p.x_val, p.y_val, p.z_val});
    data.intensity.push_back(one.intensity);
    data.ring.push_back(one.ring);
    data.time_offset.push_back(one.time_offset_s);
    data.segmentation.push_back(taken.ids[one.object]);
  }
  return data;
}

ImuData Simulator::get_imu_data(const std::string& imu, const std::string& vehicle) {
  const std::lock_guard lock(impl_->state);
  Fleet& one = impl_->vehicle(vehicle);
  const SensorSettings& sensor = sensor_of<ImuSettings>(*one.craft, imu, "IMU");
  return read_imu(std::get<ImuSettings>(sensor.kind), moment_of(*impl_, one), noise_of(one, sensor.name));
}

BarometerData Simulator::get_barometer_data(const std::string& barometer, const std::string& vehicle) {
  const std::lock_guard lock(impl_->state);
  Fleet& one = impl_->vehicle(vehicle);
  const SensorSettings& sensor = sensor_of<BarometerSettings>(*one.craft, barometer, "barometer");
  return read_barometer(std::get<BarometerSettings>(sensor.kind), moment_of(*impl_, one), noise_of(one, sensor.name));
}

MagnetometerData Simulator::get_magnetometer_data(const std::string& magnetometer, const std::string& vehicle) {
  const std::lock_guard lock(impl_->state);
  Fleet& one = impl_->vehicle(vehicle);
  const SensorSettings& sensor = sensor_of<MagnetometerSettings>(*one.craft, magnetometer, "magnetometer");
  return read_magnetometer(std::get<MagnetometerSettings>(sensor.kind), moment_of(*impl_, one),
                           noise_of(one, sensor.name));
}

GpsData Simulator::get_gps_data(const std::string& gps, const std::string& vehicle) {
  const std::lock_guard lock(impl_->state);
  Fleet& one = impl_->vehicle(vehicle);
  const SensorSettings& sensor = sensor_of<GpsSettings>(*one.craft, gps, "gps");
  return read_gps(std::get<GpsSettings>(sensor.kind), moment_of(*impl_, one), noise_of(one, sensor.name));
}

DistanceSensorData Simulator::get_distance_sensor_data(const std::string& distance_sensor, const std::string& vehicle) {
  std::vector<Look> looks;
  {
    const std::lock_guard lock(impl_->state);
    looks = impl_->looks();
  }
  const auto place = impl_->world.for_looks(looks);
  const std::lock_guard lock(impl_->state);
  Fleet& one = impl_->vehicle(vehicle);
  const SensorSettings& sensor = sensor_of<DistanceSettings>(*one.craft, distance_sensor, "distance sensor");
  const auto& settings = std::get<DistanceSettings>(sensor.kind);
  const SE3 T_local_sensor = impl_->T_local_ned * one.craft->state().T_ned_body * settings.T_body_sensor;
  const Vec3 forward = T_local_sensor.rotation * Vec3::UnitX();
  const auto hit = place->scene().intersect({T_local_sensor.translation, forward}, settings.max_m);
  const double distance_m = hit ? hit->distance_m : std::numeric_limits<double>::infinity();
  return read_distance(settings, moment_of(*impl_, one), distance_m, noise_of(one, sensor.name));
}

namespace {

KinematicsState kinematics_of(const Craft& craft) {
  const CraftState& state = craft.state();
  const Pose pose = own_pose(craft, state.T_ned_body);
  return {pose.position,
          pose.orientation,
          wire(state.velocity_m_s),
          wire(state.angular_velocity_rad_s),
          wire(state.acceleration_m_s2),
          wire(state.angular_acceleration_rad_s2)};
}

CollisionInfo collision_of(const Simulator::Impl& impl, const Craft& craft) {
  const CraftCollision& last = craft.collision();
  CollisionInfo info;
  info.has_collided = last.unread;
  if (last.time_s <= 0.0 && !last.unread) return info;
  info.penetration_depth = static_cast<float>(last.depth_m);
  info.time_stamp = impl.engine.time_ns() - static_cast<std::uint64_t>((impl.engine.time_s() - last.time_s) * 1e9);
  info.normal = wire(last.normal_ned);
  info.impact_point = wire(Vec3(last.point_ned - craft.start_ned()));
  info.position = wire(Vec3(last.position_ned - craft.start_ned()));
  info.object_name = "surface";
  info.object_id = 0;
  return info;
}

}  // namespace

KinematicsState Simulator::sim_get_ground_truth_kinematics(const std::string& vehicle) const {
  const std::lock_guard lock(impl_->state);
  return kinematics_of(*impl_->vehicle(vehicle).craft);
}

/// Of a vehicle that flies, what moves it goes on from rest at its next command.
void Simulator::sim_set_kinematics(const KinematicsState& state, bool /*ignore_collision*/,
                                   const std::string& vehicle) {
  const char* call = "simSetKinematics";
  const std::lock_guard lock(impl_->state);
  Craft& craft = *impl_->vehicle(vehicle).craft;
  CraftState wanted;
  wanted.T_ned_body = {checked_rotation(state.orientation, call),
                       checked_position(state.position, call) + craft.start_ned()};
  wanted.velocity_m_s = checked_position(state.linear_velocity, call);
  wanted.angular_velocity_rad_s = checked_position(state.angular_velocity, call);
  wanted.acceleration_m_s2 = checked_position(state.linear_acceleration, call);
  wanted.angular_acceleration_rad_s2 = checked_position(state.angular_acceleration, call);
  craft.place(wanted);
  impl_->engine.wake();
}

EnvironmentState Simulator::sim_get_ground_truth_environment(const std::string& vehicle) const {
  const std::lock_guard lock(impl_->state);
  const Craft& craft = *impl_->vehicle(vehicle).craft;
  const Vec3 position = craft.state().T_ned_body.translation;
  const sensors::Atmosphere air;
  const double height_m = atmosphere_height_m(impl_->earth.geodetic(position).height.m);
  EnvironmentState state;
  state.position = wire(Vec3(position - craft.start_ned()));
  state.geo_point = impl_->earth.geo_point(position);
  state.gravity = {0.0F, 0.0F, static_cast<float>(flight::kStandardGravity_m_s2)};
  state.air_pressure = static_cast<float>(air.pressure_pa(height_m));
  state.temperature = static_cast<float>(air.temperature_k(height_m));
  state.air_density = static_cast<float>(air.pressure_pa(height_m) / (kGasConstant * air.temperature_k(height_m)));
  return state;
}

CollisionInfo Simulator::sim_get_collision_info(const std::string& vehicle) {
  const std::lock_guard lock(impl_->state);
  Craft& craft = *impl_->vehicle(vehicle).craft;
  const CollisionInfo info = collision_of(*impl_, craft);
  craft.collision().unread = false;
  return info;
}

MultirotorState Simulator::get_multirotor_state(const std::string& vehicle) const {
  const std::lock_guard lock(impl_->state);
  const Craft& craft = *impl_->vehicle(vehicle).craft;
  MultirotorState state;
  state.collision = collision_of(*impl_, craft);
  state.kinematics_estimated = kinematics_of(craft);
  state.gps_location = impl_->earth.geo_point(craft.state().T_ned_body.translation);
  state.timestamp = impl_->engine.time_ns();
  state.landed_state = craft.landed() ? 0 : 1;
  return state;
}

RotorStates Simulator::get_rotor_states(const std::string& vehicle) const {
  const std::lock_guard lock(impl_->state);
  const Craft& craft = impl_->flying(vehicle, "getRotorStates");
  const flight::QuadrotorOptions& options = craft.options().craft;
  const flight::RotorSpeeds speeds = craft.rotor_speeds_rad_s();
  RotorStates states;
  states.timestamp = impl_->engine.time_ns();
  for (int i = 0; i < flight::kRotors; ++i) {
    const double squared = speeds[i] * speeds[i];
    const double spin = options.rotors[static_cast<std::size_t>(i)].spin;
    states.rotors.push_back({static_cast<float>(options.thrust_n_s2 * squared),
                             static_cast<float>(-spin * options.torque_nm_s2 * squared),
                             static_cast<float>(spin * speeds[i])});
  }
  return states;
}

GeoPoint Simulator::get_home_geo_point(const std::string& vehicle) const {
  const std::lock_guard lock(impl_->state);
  return impl_->earth.geo_point(impl_->vehicle(vehicle).craft->home().translation);
}

GeodeticPose Simulator::tf_geodetic_pose(const std::string& vehicle) const {
  const std::lock_guard lock(impl_->state);
  const Craft& craft = *impl_->vehicle(vehicle).craft;
  const SE3& T = craft.state().T_ned_body;
  GeodeticPose pose;
  pose.geo_point = impl_->earth.geo_point(T.translation);
  pose.altitude = impl_->earth.geodetic(T.translation).height.m;
  pose.heading = static_cast<float>(std::fmod(degrees(heading_rad(T.rotation)) + 360.0, 360.0));
  pose.orientation = wire(T.rotation);
  pose.time_stamp = impl_->engine.time_ns();
  pose.georeferenced = impl_->earth.georeferenced;
  return pose;
}

}  // namespace tileflight::simulator
