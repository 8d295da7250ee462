#include "tileflight/live/simulator/lockstep_vehicle.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "tileflight/live/simulator/frames.h"
#include "tileflight/live/simulator/simulator_impl.h"

namespace tileflight::simulator {
namespace {

using geometry::SE3;
using geometry::Vec3;

/// Of PX4's steps: magnetometer, barometer and distance sensors 50 times a second, receiver 10 times, heartbeat once.
/// Optical flow 25 times, odometry 31 times.
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
  if (simulator_.lockstep_times.contains(&slot_)) return;
  time_s_ = std::max(time_s_, simulator_.clock.time_s());
  simulator_.lockstep_times.set(&slot_, time_s_);
}

/// For the journal of a recorded session.
void LockstepVehicle::note(AutopilotEvent event) const {
  if (!simulator_.options.journal || simulator_.clock.stopped()) return;
  event.vehicle = slot_.vehicle->name();
  event.tick = simulator_.clock.steps();
  event.time_s = time_s_;
  event.T_local_body = simulator_.T_local_ned * slot_.vehicle->state().T_ned_body * T_flu_frd();
  event.touches = slot_.vehicle->landed();
  simulator_.options.journal(event);
}

void LockstepVehicle::put_at_start() {
  slot_.vehicle->return_to_start();
  slot_.history.clear();
  slot_.sensor_noises.clear();
  if (slot_.vision) slot_.vision->restart();
  elapsed_s_ = 0.0;
  flow_ = {};
}

void LockstepVehicle::restart() {
  std::unique_lock lock(simulator_.state_mutex);
  SimulationClock& clock = simulator_.clock;
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
  const SE3 T = simulator_.T_local_ned * slot_.vehicle->state().T_ned_body;
  const auto hit = simulator_.obstacle_query()(T.translation, T * Vec3(0.0, 0.0, kFlowRange_m));
  if (!hit) return std::nullopt;
  return std::max(1e-3, (hit->point - T.translation).norm());
}

std::string LockstepVehicle::apply(const AutopilotEvent& event) {
  std::unique_lock lock(simulator_.state_mutex);
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
  std::unique_lock lock(simulator_.state_mutex);
  SimulationClock& clock = simulator_.clock;
  LockstepTimes& times = simulator_.lockstep_times;
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
  const std::lock_guard lock(simulator_.state_mutex);
  LockstepTimes& times = simulator_.lockstep_times;
  times.remove(&slot_);
  if (std::isfinite(times.least_s())) simulator_.clock.allow_until(times.least_s());
  simulator_.clock.wake();
}

std::vector<std::pair<const SensorSettings*, double>> LockstepVehicle::distances_m() const {
  const vehicle::ObstacleQuery first_surface = simulator_.obstacle_query();
  std::vector<std::pair<const SensorSettings*, double>> distances_m;
  for (const SensorSettings& sensor : slot_.vehicle->settings().sensors) {
    const auto* settings = std::get_if<DistanceSensorSettings>(&sensor.kind);
    if (settings == nullptr) continue;
    const SE3 T = simulator_.T_local_ned * slot_.vehicle->state().T_ned_body * settings->T_body_sensor;
    const auto hit = first_surface(T.translation, T * Vec3(settings->max_m, 0.0, 0.0));
    const double distance_m = hit ? (hit->point - T.translation).norm() : settings->max_m;
    distances_m.emplace_back(&sensor, std::max(distance_m, settings->min_m));
  }
  return distances_m;
}

autopilot::ArduPilotState LockstepVehicle::ardupilot_state() const {
  const std::lock_guard lock(simulator_.state_mutex);
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

/// At the vehicle's own time, which may be a step before the clock's.
SensorContext LockstepVehicle::sensor_context() const {
  const std::uint64_t ahead_ns =
      static_cast<std::uint64_t>(std::llround(std::max(0.0, time_s_ - simulator_.clock.time_s()) * 1e9));
  return {
      *slot_.vehicle, slot_.history, simulator_.geodetic_frame, time_s_, simulator_.clock.time_ns() + ahead_ns, true};
}

std::string LockstepVehicle::px4_sensors(std::uint64_t step, std::uint8_t& sequence) {
  std::unique_lock lock(simulator_.state_mutex);
  SimulationClock& clock = simulator_.clock;
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
  return simulator_.plan_images({picture}, slot_.vehicle->name(), false);
}

void LockstepVehicle::look(const std::optional<PlannedImages>& exposure, std::uint64_t step) {
  if (exposure) slot_.vision->add_picture(simulator_.render_colours(*exposure), step, px4_stamp_us(step));
}

/// What is sent of vision at a step.
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

GeoPoint LockstepVehicle::home() const {
  return simulator_.geodetic_frame.to_geo_point(slot_.vehicle->home().translation);
}

double LockstepVehicle::home_heading_deg() const {
  const double heading_deg = degrees(heading_rad(slot_.vehicle->home().rotation));
  return heading_deg < 0.0 ? heading_deg + 360.0 : heading_deg;
}

}  // namespace tileflight::simulator
