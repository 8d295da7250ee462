#include "tileflight/live/simulator/viewer.h"

#include <algorithm>
#include <variant>

#include "tileflight/core/base/input_error.h"
#include "tileflight/live/simulator/frames.h"
#include "tileflight/live/simulator/world.h"

namespace tileflight::simulator {
namespace {

using geometry::SE3;

ObservedCamera observed(const SimCamera& camera) {
  return {camera.name(), T_flu_frd() * camera.T_body_camera() * T_frd_optical(),
          camera.lens(static_cast<int>(ImageType::kScene)), camera.lens(static_cast<int>(ImageType::kDepthPlanar))};
}

ObservedLocation observed(const VehicleLocation& location) {
  const odometry::MetricEstimate& found = location.estimate;
  const geometry::Mat3 R = location.T_local_world.rotation.toRotationMatrix();
  const Eigen::Quaterniond R_body_world = (found.T_world_imu.rotation * T_flu_frd().rotation.conjugate()).conjugate();
  ObservedLocation seen;
  seen.time_ns = location.time_ns;
  seen.T_local_body = location.T_local_world * found.T_world_imu * T_flu_frd().inverse();
  seen.velocity_m_s = R_body_world * found.velocity_m_s;
  seen.angular_velocity_rad_s = frd_from_flu(found.angular_rate_rad_s);
  seen.position_covariance_m2 = R * found.position_covariance_m2 * R.transpose();
  seen.rotation_covariance_rad2 = R * found.rotation_covariance_rad2 * R.transpose();
  seen.velocity_covariance_m2_s2 = R_body_world * found.velocity_covariance_m2_s2 * R_body_world.conjugate();
  return seen;
}

ObservedVehicle observed(const World& world, const VehicleSlot& slot) {
  const SimVehicle& vehicle = *slot.vehicle;
  const VehicleState& state = vehicle.state();
  ObservedVehicle seen;
  seen.name = vehicle.name();
  seen.T_local_body = world.T_local_ned * state.T_ned_body * T_flu_frd().inverse();
  seen.velocity_m_s = frd_from_flu(state.T_ned_body.rotation.conjugate() * state.velocity_m_s);
  seen.angular_velocity_rad_s = frd_from_flu(state.angular_velocity_rad_s);
  seen.flies = vehicle.settings().flies;
  seen.locates_itself = slot.vision && slot.vision->locates();
  if (slot.location) seen.location = observed(*slot.location);
  const geometry::Geodetic position = world.geodetic_frame.to_geodetic(state.T_ned_body.translation);
  seen.latitude_deg = position.latitude_deg;
  seen.longitude_deg = position.longitude_deg;
  seen.height_m = position.height.m;
  for (const SimCamera& camera : vehicle.cameras()) seen.cameras.push_back(observed(camera));
  for (const SensorSettings& sensor : vehicle.settings().sensors) {
    const auto* lidar = std::get_if<LidarSettings>(&sensor.kind);
    if (lidar != nullptr)
      seen.lidars.push_back({sensor.name, T_flu_frd() * lidar->T_body_sensor * T_flu_frd().inverse()});
    if (std::holds_alternative<ImuSettings>(sensor.kind)) seen.imus.push_back(sensor.name);
  }
  return seen;
}

}  // namespace

Observation Viewer::observe() const {
  const std::lock_guard lock(world_.state_mutex);
  Observation seen;
  seen.time_ns = world_.clock.time_ns();
  for (const auto& one : world_.vehicles) seen.vehicles.push_back(observed(world_, *one));
  return seen;
}

std::vector<ImageResponse> Viewer::images(const std::vector<ImageRequest>& requests, const std::string& vehicle) {
  PlannedImages planned;
  {
    const std::lock_guard lock(world_.state_mutex);
    planned = world_.plan_images(requests, vehicle, false);
  }
  return world_.render_images(planned);
}

ObservedMotion Viewer::imu(const std::string& imu, const std::string& vehicle) {
  const std::lock_guard lock(world_.state_mutex);
  VehicleSlot& one = world_.slot(vehicle);
  const auto& sensors = one.vehicle->settings().sensors;
  const auto sensor = std::ranges::find(sensors, imu, &SensorSettings::name);
  const auto* settings = sensor == sensors.end() ? nullptr : std::get_if<ImuSettings>(&sensor->kind);
  if (settings == nullptr) throw InputError(vehicle, "has no IMU of the name " + imu);
  SensorNoiseState& noise = one.view_noises[imu];
  noise.seed = sensor_seed(vehicle, imu);
  const ImuData reading = read_imu(*settings, world_.sensor_context(one), noise);
  const auto flu = [](const Vector3r& v) { return frd_from_flu({v.x_val, v.y_val, v.z_val}); };
  return {reading.time_stamp, flu(reading.angular_velocity), flu(reading.linear_acceleration)};
}

ObservedScan Viewer::scan(const std::string& lidar, const std::string& vehicle) {
  ObservedScan scan;
  std::vector<SensorViewpoint> viewpoints;
  LidarSettings settings;
  SE3 T_local_sensor;
  {
    const std::lock_guard lock(world_.state_mutex);
    const SimVehicle& sim_vehicle = *world_.slot(vehicle).vehicle;
    for (const SensorSettings& sensor : sim_vehicle.settings().sensors) {
      if (sensor.name == lidar) settings = std::get<LidarSettings>(sensor.kind);
    }
    T_local_sensor = world_.T_local_ned * sim_vehicle.state().T_ned_body * settings.T_body_sensor;
    scan.time_ns = world_.clock.time_ns();
    viewpoints = world_.viewpoints();
  }
  const auto place = world_.place_for(viewpoints);
  for (const LidarReturn& one : scan_lidar(*place, settings, T_local_sensor)) {
    scan.points_m.push_back(frd_from_flu(one.point_sensor).cast<float>());
    scan.intensities.push_back(one.intensity);
    scan.times_s.push_back(one.time_offset_s);
    scan.rings.push_back(one.ring);
  }
  return scan;
}

std::optional<std::vector<imaging::TexturedMesh>> Viewer::meshes(std::size_t max_triangles) const {
  const std::shared_ptr<const ResidentScene> place = world_.working_set.current();
  if (!place || place->scene().triangle_count() > max_triangles) return std::nullopt;
  const scene::Scene::Meshes meshes = place->scene().meshes();  // of the tiles: objects come and go
  return std::vector<imaging::TexturedMesh>(meshes.begin(), meshes.end());
}

}  // namespace tileflight::simulator
