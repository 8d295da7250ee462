#include "tileflight/simulator/lockstep_vehicle.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "tileflight/simulator/frames.h"
#include "tileflight/simulator/hil_readings.h"
#include "tileflight/simulator/simulator_impl.h"

namespace tileflight::simulator {
namespace {

using geometry::SE3;
using geometry::Vec3;

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

void LockstepVehicle::restart() {
  const std::lock_guard lock(simulator_.state_mutex);
  join();
  slot_.vehicle->return_to_start();
  slot_.history.clear();
  slot_.sensor_noises.clear();
  elapsed_s_ = 0.0;
}

bool LockstepVehicle::step(std::span<const double> outputs, double step_s) {
  std::unique_lock lock(simulator_.state_mutex);
  SimulationClock& clock = simulator_.clock;
  LockstepTimes& times = simulator_.lockstep_times;
  join();
  clock.wait(lock, [&] { return clock.advancing() && clock.settled() && times.least_s() >= time_s_; });
  if (clock.stopped()) return false;
  time_s_ += step_s;
  elapsed_s_ += step_s;
  slot_.vehicle->step_motors(outputs, step_s, time_s_);
  slot_.history.add(time_s_, slot_.vehicle->state(), kHistory_s);
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

autopilot::HilSensor LockstepVehicle::hil_sensor(std::uint64_t time_us, bool slow) {
  const std::lock_guard lock(simulator_.state_mutex);
  return simulator::hil_sensor(sensor_context(), slot_.sensor_noises, time_us, slow);
}

std::optional<autopilot::HilGps> LockstepVehicle::hil_gps(std::uint64_t time_us) {
  const std::lock_guard lock(simulator_.state_mutex);
  return simulator::hil_gps(sensor_context(), slot_.sensor_noises, time_us);
}

autopilot::HilStateQuaternion LockstepVehicle::hil_state(std::uint64_t time_us) const {
  const std::lock_guard lock(simulator_.state_mutex);
  return simulator::hil_state(sensor_context(), time_us);
}

std::vector<autopilot::DistanceSensor> LockstepVehicle::hil_distances(std::uint64_t time_us) {
  const std::lock_guard lock(simulator_.state_mutex);
  std::vector<autopilot::DistanceSensor> messages;
  for (const auto& [sensor, distance_m] : distances_m())
    messages.push_back(hil_distance(sensor_context(), slot_.sensor_noises, *sensor, distance_m,
                                    static_cast<std::uint8_t>(messages.size()), time_us));
  return messages;
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
