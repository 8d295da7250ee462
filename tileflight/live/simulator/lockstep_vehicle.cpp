#include "tileflight/live/simulator/lockstep_vehicle.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "tileflight/capture/sensors/barometer.h"
#include "tileflight/core/base/random_numbers.h"
#include "tileflight/live/simulator/frames.h"
#include "tileflight/live/simulator/world.h"

namespace tileflight::simulator {
namespace {

using geometry::Vec3;

constexpr double kPascalPerHectopascal = 100.0, kCelsius_k = 273.15;
constexpr std::uint8_t kSatellites = 10;

/// Returns three standard normal numbers that depend only on the sensor, `which` and the time.
Vec3 white_noise(const SensorContext& now, SensorNoises& noises, const std::string& name, std::uint64_t which) {
  const auto normals =
      base::normal_variates(base::stream_key(noise_of(noises, now.vehicle.name(), name).seed, which), now.time_ns);
  return {normals[0], normals[1], normals[2]};
}

/// Returns settings and noise of the vehicle's first sensor of a kind.
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
  return {settings, noise_of(noises, now.vehicle.name(), name)};
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
  const DistanceSensorData reading =
      read_distance(settings, now, distance_m, noise_of(noises, now.vehicle.name(), sensor.name));
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

/// The flow in the middle of the image of a camera with axes forward, right, down that moves by v and turns by w, of a
/// surface at distance d: w_x - v_y / d and w_y + v_x / d (Longuet-Higgins, Prazdny 1980).
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

namespace {

using geometry::SE3;

/// Intervals in steps of PX4. In a second they make 50 readings of magnetometer, barometer and distance sensors, 10 of
/// the satellite receiver, 25 of the optical flow, 31 of the odometry, and 1 heartbeat.
constexpr std::uint64_t kSlowSteps = 5, kGpsSteps = 25, kHeartbeatSteps = 250, kFlowSteps = 10, kOdometrySteps = 8;
constexpr double kFlowRange_m = 100.0;

template <class Message>
std::string frame(std::uint8_t& sequence, const Message& message) {
  return autopilot::encode_frame(Message::kMessage,
                                 {.sequence = sequence++, .payload = autopilot::encode_payload(message)});
}

}  // namespace

double LockstepTimes::least_s() const {
  double least_s = std::numeric_limits<double>::infinity();
  for (const auto& [vehicle, time_s] : times_s_) least_s = std::min(least_s, time_s);
  return least_s;
}

/// An autopilot that comes, or comes back, takes part from the clock's present time on.
void LockstepVehicle::join() {
  if (world_.lockstep_times.contains(&slot_)) return;
  time_s_ = std::max(time_s_, world_.clock.time_s());
  world_.lockstep_times.set(&slot_, time_s_);
}

/// Completes an event and passes it to the journal of a recorded session.
void LockstepVehicle::note(AutopilotEvent event) const {
  if (!world_.options.journal || world_.clock.stopped()) return;
  event.vehicle = slot_.vehicle->name();
  event.tick = world_.clock.steps();
  event.time_s = time_s_;
  event.T_local_body = world_.T_local_ned * slot_.vehicle->state().T_ned_body * T_flu_frd();
  event.touches = slot_.vehicle->landed();
  world_.options.journal(event);
}

void LockstepVehicle::put_at_start() {
  slot_.vehicle->return_to_start();
  slot_.history.clear();
  slot_.sensor_noises.clear();
  if (slot_.vision) slot_.vision->restart();
  slot_.location.reset();
  elapsed_s_ = 0.0;
  flow_ = {};
}

void LockstepVehicle::restart() {
  std::unique_lock lock(world_.state_mutex);
  SimulationClock& clock = world_.clock;
  clock.wait(lock, [&] { return clock.turn_is_free() && clock.settled(); });
  join();
  put_at_start();
  note({.kind = AutopilotEvent::Kind::kRestart});
}

/// `time_s_`, the vehicle's time, has come to the end of the step.
void LockstepVehicle::move(std::span<const double> outputs, double step_s) {
  elapsed_s_ += step_s;
  slot_.vehicle->step_motors(outputs, step_s, time_s_);
  slot_.history.add(time_s_, slot_.vehicle->state(), kHistory_s);
  if (slot_.vehicle->settings().autopilot->optical_flow) flow_.add(slot_.vehicle->state(), distance_below_m(), step_s);
}

std::optional<double> LockstepVehicle::distance_below_m() const {
  const SE3 T = world_.T_local_ned * slot_.vehicle->state().T_ned_body;
  const auto hit = world_.obstacle_query()(T.translation, T * Vec3(0.0, 0.0, kFlowRange_m));
  if (!hit) return std::nullopt;
  return std::max(1e-3, (hit->point - T.translation).norm());
}

std::string LockstepVehicle::apply(const AutopilotEvent& event) {
  std::unique_lock lock(world_.state_mutex);
  time_s_ = event.time_s;
  if (event.kind == AutopilotEvent::Kind::kSensors) {
    std::string bytes = read_px4_sensors(event.number, repeated_sequence_);
    const auto exposure = exposure_at(event.number);
    lock.unlock();
    look(exposure, event.number);
    return bytes;
  }
  if (event.kind == AutopilotEvent::Kind::kStep) {
    base::require(event.outputs.size() == motors(), "vehicle '" + name() + "'",
                  "has another number of motors than in the session");
    move(event.outputs, event.step_s);
  } else {
    put_at_start();
    repeated_sequence_ = 0;
  }
  return {};
}

bool LockstepVehicle::step(std::span<const double> outputs, double step_s) {
  std::unique_lock lock(world_.state_mutex);
  SimulationClock& clock = world_.clock;
  LockstepTimes& times = world_.lockstep_times;
  join();
  clock.wait(
      lock, [&] { return clock.advancing() && clock.settled() && clock.turn_is_free() && times.least_s() >= time_s_; });
  if (clock.stopped()) return false;
  time_s_ += step_s;
  move(outputs, step_s);
  note({.kind = AutopilotEvent::Kind::kStep,
        .step_s = step_s,
        .outputs = std::vector<double>(outputs.begin(), outputs.end())});
  times.set(&slot_, time_s_);
  clock.allow_until(times.least_s());
  clock.wait(lock, [&] { return clock.settled(); });
  return !clock.stopped();
}

void LockstepVehicle::leave() {
  const std::lock_guard lock(world_.state_mutex);
  LockstepTimes& times = world_.lockstep_times;
  times.remove(&slot_);
  if (std::isfinite(times.least_s())) world_.clock.allow_until(times.least_s());
  world_.clock.wake();
}

std::vector<std::pair<const SensorSettings*, double>> LockstepVehicle::distances_m() const {
  const vehicle::ObstacleQuery first_surface = world_.obstacle_query();
  std::vector<std::pair<const SensorSettings*, double>> distances_m;
  for (const SensorSettings& sensor : slot_.vehicle->settings().sensors) {
    const auto* settings = std::get_if<DistanceSensorSettings>(&sensor.kind);
    if (settings == nullptr) continue;
    const SE3 T = world_.T_local_ned * slot_.vehicle->state().T_ned_body * settings->T_body_sensor;
    const auto hit = first_surface(T.translation, T * Vec3(settings->max_m, 0.0, 0.0));
    const double distance_m = hit ? (hit->point - T.translation).norm() : settings->max_m;
    distances_m.emplace_back(&sensor, std::max(distance_m, settings->min_m));
  }
  return distances_m;
}

autopilot::ArduPilotState LockstepVehicle::ardupilot_state() const {
  const std::lock_guard lock(world_.state_mutex);
  const SimVehicle& vehicle = *slot_.vehicle;
  const VehicleState& now = vehicle.state();
  const Eigen::Quaterniond R_body_ned = now.T_ned_body.rotation.conjugate();
  const Vec3 gravity(0.0, 0.0, vehicle::kStandardGravity_m_s2);
  const Vec3 wind_relative_m_s = R_body_ned * (vehicle.wind_ned_m_s() - now.velocity_m_s);
  autopilot::ArduPilotState state;
  state.time_s = elapsed_s_;
  state.gyro_rad_s = now.angular_velocity_rad_s;
  state.accelerometer_m_s2 = R_body_ned * (now.acceleration_m_s2 - gravity);
  state.position_m = now.T_ned_body.translation - vehicle.home().translation;
  state.R_ned_body = now.T_ned_body.rotation;
  state.velocity_m_s = now.velocity_m_s;
  for (const auto& [sensor, distance_m] : distances_m()) state.ranges_m.push_back(distance_m);
  state.wind_vane = autopilot::wind_vane(wind_relative_m_s);
  state.wind_m_s = vehicle.wind_ned_m_s();
  state.airspeed_m_s = wind_relative_m_s.norm();
  return state;
}

/// Uses the vehicle's own time, which may be a step before the clock's.
SensorContext LockstepVehicle::sensor_context() const {
  const std::uint64_t ahead_ns =
      static_cast<std::uint64_t>(std::llround(std::max(0.0, time_s_ - world_.clock.time_s()) * 1e9));
  return {*slot_.vehicle, slot_.history, world_.geodetic_frame, time_s_, world_.clock.time_ns() + ahead_ns, true};
}

std::string LockstepVehicle::px4_sensors(std::uint64_t step, std::uint8_t& sequence) {
  std::unique_lock lock(world_.state_mutex);
  SimulationClock& clock = world_.clock;
  clock.wait(lock, [&] { return clock.turn_is_free() && clock.settled(); });
  std::string bytes = read_px4_sensors(step, sequence);
  note({.kind = AutopilotEvent::Kind::kSensors, .number = step, .bytes = bytes});
  const auto exposure = exposure_at(step);
  lock.unlock();
  look(exposure, step);
  return bytes;
}

std::optional<PlannedImages> LockstepVehicle::exposure_at(std::uint64_t step) const {
  if (!slot_.vision || !slot_.vision->is_exposure(step)) return std::nullopt;
  ImageRequest picture;
  picture.camera_name = slot_.vision->camera();
  picture.image_type = static_cast<int>(ImageType::kScene);
  return world_.plan_images({picture}, slot_.vehicle->name(), false);
}

void LockstepVehicle::look(const std::optional<PlannedImages>& exposure, std::uint64_t step) {
  if (!exposure) return;
  imaging::RgbImage picture = world_.render_colours(*exposure);
  const SE3 T_local_body = world_.T_local_ned * slot_.vehicle->state().T_ned_body;
  slot_.vision->add_picture(std::move(picture), step, px4_stamp_us(step), T_local_body);
  const auto& found = slot_.vision->latest();
  if (!slot_.vision->locates() || !found) return;
  const std::lock_guard lock(world_.state_mutex);
  slot_.location = VehicleLocation{exposure->time_ns, *found, slot_.vision->T_local_world()};
}

/// Returns the message of the vision input that is sent at a step.
std::optional<autopilot::Odometry> LockstepVehicle::vision_at(std::uint64_t step, const SensorContext& now) {
  if (slot_.vision) return slot_.vision->message_at(step);
  const bool is_due =
      slot_.vehicle->settings().autopilot->vision.source == VisionSource::kTruth && step % kOdometrySteps == 0;
  return is_due ? std::optional(hil_odometry(now, slot_.sensor_noises, px4_stamp_us(step))) : std::nullopt;
}

std::string LockstepVehicle::read_px4_sensors(std::uint64_t step, std::uint8_t& sequence) {
  const std::uint64_t now_us = px4_stamp_us(step);
  const SensorContext now = sensor_context();
  SensorNoises& noises = slot_.sensor_noises;
  const bool slow = step % kSlowSteps == 0;
  std::string bytes;
  if (step % kHeartbeatSteps == 0) bytes += frame(sequence, autopilot::Heartbeat{});
  bytes += frame(sequence, hil_state(now, now_us));
  if (step % kGpsSteps == 0) {
    if (const auto gps = hil_gps(now, noises, now_us)) bytes += frame(sequence, *gps);
  }
  if (slow) {
    std::uint8_t id = 0;
    for (const auto& [sensor, distance_m] : distances_m())
      bytes += frame(sequence, hil_distance(now, noises, *sensor, distance_m, id++, now_us));
  }
  const AutopilotSettings& settings = *slot_.vehicle->settings().autopilot;
  if (settings.optical_flow && step % kFlowSteps == 0 && step > 0)
    bytes += frame(sequence, hil_flow(now, noises, std::exchange(flow_, {}), distance_below_m(), now_us));
  if (const auto seen = vision_at(step, now)) bytes += frame(sequence, *seen);
  const autopilot::HilSensor sensor = hil_sensor(now, noises, now_us, slow);
  if (slot_.vision) slot_.vision->add_reading(sensor);
  return bytes + frame(sequence, sensor);  // last: PX4 answers to it
}

const std::string& LockstepVehicle::name() const { return slot_.vehicle->name(); }

std::size_t LockstepVehicle::motors() const { return slot_.vehicle->rotors().size(); }

GeoPoint LockstepVehicle::home() const { return world_.geodetic_frame.to_geo_point(slot_.vehicle->home().translation); }

double LockstepVehicle::home_heading_deg() const {
  const double heading_deg = degrees(heading_rad(slot_.vehicle->home().rotation));
  return heading_deg < 0.0 ? heading_deg + 360.0 : heading_deg;
}

}  // namespace tileflight::simulator
