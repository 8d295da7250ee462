#include "tileflight/live/simulator/hil_readings.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "tileflight/core/base/random_numbers.h"
#include "tileflight/capture/sensors/barometer.h"
#include "tileflight/live/simulator/frames.h"

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

/// Three standard normal numbers, the same for the same time.
Vec3 white_noise(const SensorContext& now, SensorNoises& noises, const std::string& name, std::uint64_t which) {
  const auto normals = base::normal_variates(base::stream_key(noise_of(now, noises, name).seed, which), now.time_ns);
  return {normals[0], normals[1], normals[2]};
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
  const auto is_receiver = [](const SensorSettings& one) { return std::holds_alternative<GpsSettings>(one.kind); };
  if (std::ranges::none_of(now.vehicle.settings().sensors, is_receiver)) return std::nullopt;
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

/// Of what is at distance d on the axis of a camera with axes forward, right, down that moves by v and turns by w: w_x
/// - v_y / d and w_y + v_x / d (Longuet-Higgins, Prazdny 1980, at the image's middle).
void FlowIntegral::add(const VehicleState& state, std::optional<double> distance_m, double step_s) {
  const Vec3& turning = state.angular_velocity_rad_s;
  const Vec3 velocity_m_s = state.T_ned_body.rotation.conjugate() * state.velocity_m_s;
  const double per_m = distance_m ? 1.0 / *distance_m : 0.0;
  flow_rad += step_s * Eigen::Vector2d(turning.x() - velocity_m_s.y() * per_m, turning.y() + velocity_m_s.x() * per_m);
  gyro_rad += step_s * turning;
  duration_s += step_s;
  sees_surface = sees_surface && distance_m.has_value();
}

autopilot::HilOpticalFlow hil_flow(const SensorContext& now, SensorNoises& noises, const FlowIntegral& flow,
                                   std::optional<double> distance_m, std::uint64_t time_us) {
  constexpr double kSigma_rad_s = 0.02;
  constexpr std::uint8_t kGood = 255;
  const Vec3 noise = white_noise(now, noises, "optical flow", 0) * (kSigma_rad_s * flow.duration_s);
  autopilot::HilOpticalFlow message;
  message.time_us = time_us;
  message.integration_us = whole<std::uint32_t>(1e6 * flow.duration_s);
  message.flow_rad = {static_cast<float>(flow.flow_rad.x() + noise.x()),
                      static_cast<float>(flow.flow_rad.y() + noise.y())};
  message.gyro_rad = floats(flow.gyro_rad);
  message.distance_m = distance_m ? static_cast<float>(*distance_m) : -1.0F;
  message.quality = flow.sees_surface ? kGood : 0;
  return message;
}

autopilot::Odometry hil_odometry(const SensorContext& now, SensorNoises& noises, std::uint64_t time_us) {
  constexpr double kPosition_m = 0.05, kRotation_rad = 0.01, kVelocity_m_s = 0.05, kRate_rad_s = 0.01;
  constexpr std::array<std::size_t, 6> kDiagonal{0, 6, 11, 15, 18, 20};
  const VehicleState& state = now.vehicle.state();
  const auto noise = [&](std::uint64_t which) { return white_noise(now, noises, "vision odometry", which); };
  const Vec3 turned_rad = kRotation_rad * noise(1);
  const Eigen::Quaterniond small(Eigen::AngleAxisd(turned_rad.norm(), turned_rad.normalized()));
  const Eigen::Quaterniond q = state.T_ned_body.rotation * small;
  const Vec3 velocity_m_s = state.T_ned_body.rotation.conjugate() * state.velocity_m_s;
  autopilot::Odometry message;
  message.time_us = time_us;
  message.position_m = floats(state.T_ned_body.translation - now.vehicle.home().translation + kPosition_m * noise(0));
  message.attitude_wxyz = {static_cast<float>(q.w()), static_cast<float>(q.x()), static_cast<float>(q.y()),
                           static_cast<float>(q.z())};
  message.velocity_m_s = floats(velocity_m_s + kVelocity_m_s * noise(2));
  message.rates_rad_s = floats(state.angular_velocity_rad_s + kRate_rad_s * noise(3));
  for (std::size_t i = 0; i < kDiagonal.size(); ++i) {
    const double pose = i < 3 ? kPosition_m : kRotation_rad, motion = i < 3 ? kVelocity_m_s : kRate_rad_s;
    message.pose_covariance[kDiagonal[i]] = static_cast<float>(pose * pose);
    message.velocity_covariance[kDiagonal[i]] = static_cast<float>(motion * motion);
  }
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
