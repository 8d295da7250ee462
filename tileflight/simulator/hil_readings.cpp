#include "tileflight/simulator/hil_readings.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "tileflight/sensors/barometer.h"
#include "tileflight/simulator/frames.h"

namespace tileflight::simulator {
namespace {

using geometry::Vec3;

constexpr double kPascalPerHectopascal = 100.0, kCelsius_k = 273.15;
constexpr std::uint8_t kSatellites = 10;

SensorNoiseState& noise_of(const SensorContext& now, SensorNoises& noises, const std::string& name) {
  const auto [at, is_new] = noises.try_emplace(name);
  if (is_new) at->second.seed = sensor_seed(now.vehicle.name(), name);
  return at->second;
}

/// Settings and noise of the vehicle's first sensor of a kind.
template <class Settings>
std::pair<Settings, SensorNoiseState&> first_sensor(const SensorContext& now, SensorNoises& noises) {
  Settings settings;
  std::string name = "default " + std::to_string(SensorKind(Settings{}).index());
  for (const SensorSettings& sensor : now.vehicle.settings().sensors) {
    if (!std::holds_alternative<Settings>(sensor.kind)) continue;
    settings = std::get<Settings>(sensor.kind);
    name = sensor.name;
    break;
  }
  return {settings, noise_of(now, noises, name)};
}

std::array<float, 3> floats(const Vector3r& v) { return {v.x_val, v.y_val, v.z_val}; }
std::array<float, 3> floats(const Vec3& v) { return floats(to_airsim(v)); }

/// Rounded, and kept within what the field can hold.
template <class Integer>
Integer whole(double value) {
  using Limits = std::numeric_limits<Integer>;
  return static_cast<Integer>(
      std::clamp(std::round(value), static_cast<double>(Limits::min()), static_cast<double>(Limits::max())));
}

std::array<std::int16_t, 3> hundredths(const Vec3& v) {
  return {whole<std::int16_t>(100.0 * v.x()), whole<std::int16_t>(100.0 * v.y()), whole<std::int16_t>(100.0 * v.z())};
}

/// The named orientation of an axis (forward, right, down), if it is within a degree of one.
std::uint8_t orientation_of(const Vec3& axis) {
  const double least_cosine = std::cos(radians(1.0));
  if (axis.z() > least_cosine) return autopilot::kDown;
  if (axis.z() < -least_cosine) return autopilot::kUp;
  for (int eighth = 0; eighth < 8; ++eighth) {
    const double turned_rad = radians(45.0 * eighth);
    if (axis.dot(Vec3(std::cos(turned_rad), std::sin(turned_rad), 0.0)) > least_cosine)
      return static_cast<std::uint8_t>(autopilot::kForward + eighth);
  }
  return autopilot::kByQuaternion;
}

}  // namespace

autopilot::HilSensor hil_sensor(const SensorContext& now, SensorNoises& noises, std::uint64_t time_us, bool slow) {
  using namespace autopilot;
  const auto [imu_settings, imu_noise] = first_sensor<ImuSettings>(now, noises);
  const auto [magnetometer_settings, magnetometer_noise] = first_sensor<MagnetometerSettings>(now, noises);
  const auto [barometer_settings, barometer_noise] = first_sensor<BarometerSettings>(now, noises);
  const ImuData imu = read_imu(imu_settings, now, imu_noise);
  const BarometerData air = read_barometer(barometer_settings, now, barometer_noise);
  HilSensor message;
  message.time_us = time_us;
  message.accelerometer_m_s2 = floats(imu.linear_acceleration);
  message.gyro_rad_s = floats(imu.angular_velocity);
  message.magnetometer_gauss =
      floats(read_magnetometer(magnetometer_settings, now, magnetometer_noise).magnetic_field_body);
  message.pressure_hpa = static_cast<float>(air.pressure / kPascalPerHectopascal);
  message.pressure_altitude_m = air.altitude;
  message.temperature_c =
      static_cast<float>(sensors::Atmosphere{}.temperature_k(clamp_atmosphere_height_m(air.altitude)) - kCelsius_k);
  message.updated = kAccelerometerUpdated | kGyroUpdated;
  if (slow) message.updated |= kMagnetometerUpdated | kBarometerUpdated;
  return message;
}

std::optional<autopilot::HilGps> hil_gps(const SensorContext& now, SensorNoises& noises, std::uint64_t time_us) {
  const auto [settings, noise] = first_sensor<GpsSettings>(now, noises);
  const GpsData reading = read_gps(settings, now, noise);
  if (!reading.is_valid) return std::nullopt;
  const Vec3 velocity_m_s = to_vec3(reading.gnss.velocity);
  const double course_deg = degrees(std::atan2(velocity_m_s.y(), velocity_m_s.x()));
  autopilot::HilGps message;
  message.time_us = time_us;
  message.latitude_e7_deg = whole<std::int32_t>(1e7 * reading.gnss.geo_point.latitude);
  message.longitude_e7_deg = whole<std::int32_t>(1e7 * reading.gnss.geo_point.longitude);
  message.altitude_mm = whole<std::int32_t>(1e3 * reading.gnss.geo_point.altitude);
  message.eph_cm = whole<std::uint16_t>(100.0 * reading.gnss.eph);
  message.epv_cm = whole<std::uint16_t>(100.0 * reading.gnss.epv);
  message.speed_cm_s = whole<std::uint16_t>(100.0 * velocity_m_s.head<2>().norm());
  message.velocity_ned_cm_s = hundredths(velocity_m_s);
  message.course_cdeg = whole<std::uint16_t>(100.0 * (course_deg < 0.0 ? course_deg + 360.0 : course_deg));
  message.fix_type = static_cast<std::uint8_t>(reading.gnss.fix_type);
  message.satellites = kSatellites;
  return message;
}

autopilot::DistanceSensor hil_distance(const SensorContext& now, SensorNoises& noises, const SensorSettings& sensor,
                                       double distance_m, std::uint8_t id, std::uint64_t time_us) {
  const auto& settings = std::get<DistanceSensorSettings>(sensor.kind);
  const DistanceSensorData reading = read_distance(settings, now, distance_m, noise_of(now, noises, sensor.name));
  const Eigen::Quaterniond& q = settings.T_body_sensor.rotation;
  autopilot::DistanceSensor message;
  message.time_ms = static_cast<std::uint32_t>(time_us / 1000);
  message.min_cm = whole<std::uint16_t>(100.0 * settings.min_m);
  message.max_cm = whole<std::uint16_t>(100.0 * settings.max_m);
  message.distance_cm = whole<std::uint16_t>(100.0 * reading.distance);
  message.id = id;
  message.orientation = orientation_of(q * Vec3::UnitX());
  if (message.orientation == autopilot::kByQuaternion)
    message.attitude_wxyz = {static_cast<float>(q.w()), static_cast<float>(q.x()), static_cast<float>(q.y()),
                             static_cast<float>(q.z())};
  return message;
}

autopilot::HilStateQuaternion hil_state(const SensorContext& now, std::uint64_t time_us) {
  const VehicleState& state = now.vehicle.state();
  const Eigen::Quaterniond& q = state.T_ned_body.rotation;
  const geometry::Geodetic place = now.geodetic_frame.to_geodetic(state.T_ned_body.translation);
  const Vec3 through_air = state.velocity_m_s - now.vehicle.wind_ned_m_s();
  const Vec3 force_g = q.conjugate() * (state.acceleration_m_s2 - Vec3(0, 0, vehicle::kStandardGravity_m_s2)) /
                       vehicle::kStandardGravity_m_s2;
  autopilot::HilStateQuaternion message;
  message.time_us = time_us;
  message.attitude_wxyz = {static_cast<float>(q.w()), static_cast<float>(q.x()), static_cast<float>(q.y()),
                           static_cast<float>(q.z())};
  message.rates_rad_s = floats(state.angular_velocity_rad_s);
  message.latitude_e7_deg = whole<std::int32_t>(1e7 * place.latitude_deg);
  message.longitude_e7_deg = whole<std::int32_t>(1e7 * place.longitude_deg);
  message.altitude_mm = whole<std::int32_t>(1e3 * place.height.m);
  message.velocity_ned_cm_s = hundredths(state.velocity_m_s);
  message.indicated_airspeed_cm_s = message.true_airspeed_cm_s = whole<std::uint16_t>(100.0 * through_air.norm());
  message.acceleration_mg = hundredths(10.0 * force_g);
  return message;
}

}  // namespace tileflight::simulator
