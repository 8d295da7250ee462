#include "tileflight/live/simulator/sensors.h"

#include <limits>
#include <stdexcept>

#include "tileflight/live/simulator/frames.h"
#include "tileflight/live/simulator/object_labels.h"
#include "tileflight/live/simulator/range_sensors.h"
#include "tileflight/live/simulator/world.h"

namespace tileflight::simulator {
namespace {

using geometry::SE3;
using geometry::Vec3;

/// The sensor of this kind and name, or the first of its kind for an empty name. Errors use AirSim's wording.
template <class Kind>
const SensorSettings& find_sensor(const SimVehicle& sim_vehicle, const std::string& name, const char* kind) {
  for (const SensorSettings& sensor : sim_vehicle.settings().sensors) {
    if (std::holds_alternative<Kind>(sensor.kind) && (name.empty() || sensor.name == name)) return sensor;
  }
  throw std::runtime_error("No " + std::string(kind) + " with name " + name.substr(0, 100) + " exist on vehicle");
}

/// Reads a sensor that needs no more than its vehicle's states.
template <class Settings, class Data>
Data read_plain_sensor(World& world, const std::string& vehicle, const std::string& name, const char* kind,
                       Data (*read)(const Settings&, const SensorContext&, SensorNoiseState&)) {
  const std::lock_guard lock(world.state_mutex);
  VehicleSlot& one = world.slot(vehicle);
  const SensorSettings& sensor = find_sensor<Settings>(*one.vehicle, name, kind);
  return read(std::get<Settings>(sensor.kind), world.sensor_context(one),
              noise_of(one.sensor_noises, one.vehicle->name(), sensor.name));
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

LidarCapture capture_scan(World& world, const std::string& lidar, const std::string& vehicle) {
  LidarCapture taken;
  std::vector<SensorViewpoint> viewpoints;
  {
    const std::lock_guard lock(world.state_mutex);
    const SimVehicle& sim_vehicle = *world.slot(vehicle).vehicle;
    taken.settings = std::get<LidarSettings>(find_sensor<LidarSettings>(sim_vehicle, lidar, "lidar").kind);
    taken.T_ned_sensor = sim_vehicle.state().T_ned_body * taken.settings.T_body_sensor;
    taken.start_ned = sim_vehicle.start_ned();
    taken.time_ns = world.clock.time_ns();
    viewpoints = world.viewpoints();
  }
  const auto place = world.place_for(viewpoints);
  taken.returns = scan_lidar(*place, taken.settings, world.T_local_ned * taken.T_ned_sensor);
  taken.segmentation_ids = world.segmentation_ids.lookup(place->object_names());
  return taken;
}

}  // namespace

LidarData Sensors::get_lidar_data(const std::string& lidar, const std::string& vehicle) {
  const LidarCapture taken = capture_scan(world_, lidar, vehicle);
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

std::vector<int> Sensors::get_lidar_segmentation(const std::string& lidar, const std::string& vehicle) {
  return get_lidar_data(lidar, vehicle).segmentation;
}

GPULidarData Sensors::get_gpu_lidar_data(const std::string& lidar, const std::string& vehicle) {
  const LidarCapture taken = capture_scan(world_, lidar, vehicle);
  GPULidarData data;
  data.time_stamp = taken.time_ns;
  data.pose = to_airsim(taken.settings.T_body_sensor);
  data.point_cloud.reserve(5 * taken.returns.size());
  for (const LidarReturn& one : taken.returns) {
    const Vector3r p = taken.point(one);
    // 24 bits: exact in a float.
    const auto colour = static_cast<float>(colour_number(segmentation_colour(taken.segmentation_ids[one.object])));
    data.point_cloud.insert(data.point_cloud.end(), {p.x_val, p.y_val, p.z_val, colour, one.intensity});
  }
  return data;
}

EchoData Sensors::get_echo_data(const std::string& echo, const std::string& vehicle) {
  EchoData data;
  EchoSettings settings;
  SE3 T_local_sensor;
  std::vector<SensorViewpoint> viewpoints;
  {
    const std::lock_guard lock(world_.state_mutex);
    const SimVehicle& sim_vehicle = *world_.slot(vehicle).vehicle;
    settings = std::get<EchoSettings>(find_sensor<EchoSettings>(sim_vehicle, echo, "echo").kind);
    T_local_sensor = world_.T_local_ned * sim_vehicle.state().T_ned_body * settings.T_body_sensor;
    data.time_stamp = world_.clock.time_ns();
    viewpoints = world_.viewpoints();
  }
  const auto place = world_.place_for(viewpoints);
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

LidarScanData Sensors::lidar_scan(const std::string& lidar, const std::string& vehicle) {
  const LidarCapture taken = capture_scan(world_, lidar, vehicle);
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

ImuData Sensors::get_imu_data(const std::string& imu, const std::string& vehicle) {
  return read_plain_sensor<ImuSettings>(world_, vehicle, imu, "IMU", read_imu);
}

BarometerData Sensors::get_barometer_data(const std::string& barometer, const std::string& vehicle) {
  return read_plain_sensor<BarometerSettings>(world_, vehicle, barometer, "barometer", read_barometer);
}

MagnetometerData Sensors::get_magnetometer_data(const std::string& magnetometer, const std::string& vehicle) {
  return read_plain_sensor<MagnetometerSettings>(world_, vehicle, magnetometer, "magnetometer", read_magnetometer);
}

GpsData Sensors::get_gps_data(const std::string& gps, const std::string& vehicle) {
  return read_plain_sensor<GpsSettings>(world_, vehicle, gps, "gps", read_gps);
}

DistanceSensorData Sensors::get_distance_sensor_data(const std::string& distance_sensor, const std::string& vehicle) {
  std::vector<SensorViewpoint> viewpoints;
  {
    const std::lock_guard lock(world_.state_mutex);
    viewpoints = world_.viewpoints();
  }
  const auto place = world_.place_for(viewpoints);
  const std::lock_guard lock(world_.state_mutex);
  VehicleSlot& one = world_.slot(vehicle);
  const SensorSettings& sensor = find_sensor<DistanceSensorSettings>(*one.vehicle, distance_sensor, "distance sensor");
  const auto& settings = std::get<DistanceSensorSettings>(sensor.kind);
  const SE3 T_local_sensor = world_.T_local_ned * one.vehicle->state().T_ned_body * settings.T_body_sensor;
  const Vec3 forward = T_local_sensor.rotation * Vec3::UnitX();
  const auto hit = place->scene().intersect({T_local_sensor.translation, forward}, settings.max_m);
  const double distance_m = hit ? hit->distance_m : std::numeric_limits<double>::infinity();
  return read_distance(settings, world_.sensor_context(one), distance_m,
                       noise_of(one.sensor_noises, one.vehicle->name(), sensor.name));
}

}  // namespace tileflight::simulator
