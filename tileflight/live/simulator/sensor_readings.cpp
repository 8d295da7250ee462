#include "tileflight/live/simulator/sensor_readings.h"

#include <algorithm>
#include <cmath>

#include "tileflight/capture/sensors/barometer.h"
#include "tileflight/capture/sensors/gauss_markov.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/random_numbers.h"
#include "tileflight/live/simulator/frames.h"
#include "tileflight/live/simulator/simulation_clock.h"

namespace tileflight::simulator {
namespace {

using geometry::Vec3;

constexpr double kHour_s = 3600.0;
constexpr double kMicroGravity_m_s2 = 1e-6 * vehicle::kStandardGravity_m_s2;

/// Standard normal numbers for a reading: the same for the same time.
class NormalGenerator {
 public:
  NormalGenerator(std::uint64_t seed, std::uint64_t time_ns) : key_(seed), counter_(time_ns) {}

  double next() {
    if (used_ == 4) {
      normals_ = base::normal_variates(base::stream_key(key_, block_++), counter_);
      used_ = 0;
    }
    return normals_[used_++];
  }
  Vec3 next3() {
    const double x = next(), y = next();
    return {x, y, next()};
  }

 private:
  std::uint64_t key_, counter_;
  std::uint64_t block_ = 0;
  std::size_t used_ = 4;
  std::array<float, 4> normals_{};
};

/// Advances the three biases from index `first` on to the current time.
Vec3 bias3(SensorNoiseState& noise, std::size_t first, double sigma, double tau_s, double elapsed_s,
           NormalGenerator& normals) {
  Vec3 bias = Vec3::Zero();
  for (std::size_t i = 0; i < 3; ++i) {
    double& value = noise.biases[first + i];
    value = sensors::gauss_markov_step(value, sigma, std::exp(-elapsed_s / tau_s), normals.next());
    bias[static_cast<Eigen::Index>(i)] = value;
  }
  return bias;
}

double elapsed_s(SensorNoiseState& noise, double time_s) {
  const double elapsed = std::max(0.0, time_s - noise.last_read_s);
  noise.last_read_s = time_s;
  return elapsed;
}

/// The state that a reading refers to: that of the sensor's latest tick, delayed by its latency.
struct DelayedState {
  double time_s;
  std::uint64_t time_ns;
  VehicleState state;
};

DelayedState delayed_state(const SensorTiming& timing, const SensorContext& now) {
  if (!now.moving) return {now.time_s, now.time_ns, now.vehicle.state()};
  const double ticks = std::floor((now.time_s - timing.latency_s) * timing.frequency_hz + 1e-9);
  const double time_s = std::max(0.0, ticks / timing.frequency_hz);
  const auto late_ns = static_cast<std::uint64_t>(std::max(0.0, (now.time_s - time_s) * 1e9));
  const VehicleState* state = now.history.at(time_s);
  return {time_s, now.time_ns - late_ns, state != nullptr ? *state : now.vehicle.state()};
}

}  // namespace

GeoPoint GeodeticFrame::to_geo_point(const Vec3& ned) const {
  const geometry::Geodetic place = to_geodetic(ned);
  return {place.latitude_deg, place.longitude_deg, static_cast<float>(place.height.m)};
}

Vec3 GeodeticFrame::to_ned(const GeoPoint& point) const {
  if (!(std::abs(point.latitude) <= 90.0 && std::abs(point.longitude) <= 360.0 && std::abs(point.altitude) <= 1e6F))
    throw InputError("geographic point", "its latitude, longitude or altitude is out of range");
  return T_local_ned.inverse() * local_frame.local_from_geodetic({point.latitude, point.longitude, {point.altitude}});
}

std::uint64_t sensor_seed(const std::string& vehicle, const std::string& sensor) {
  std::uint64_t seed = 1469598103934665603ULL;  // FNV-1a
  for (const char c : vehicle + "/" + sensor) seed = (seed ^ static_cast<unsigned char>(c)) * 1099511628211ULL;
  return seed;
}

SensorNoiseState& noise_of(SensorNoises& noises, const std::string& vehicle, const std::string& sensor) {
  const auto [at, is_new] = noises.try_emplace(sensor);
  if (is_new) at->second.seed = sensor_seed(vehicle, sensor);
  return at->second;
}

double clamp_atmosphere_height_m(double height_m) { return std::clamp(height_m, -4999.0, 10999.0); }

void StateHistory::add(double time_s, const VehicleState& state, double keep_s) {
  states_.emplace_back(time_s, state);
  while (states_.size() > 1 && states_[1].first <= time_s - keep_s) states_.pop_front();
}

const VehicleState* StateHistory::at(double time_s) const {
  if (states_.empty()) return nullptr;
  const auto after = std::upper_bound(states_.begin(), states_.end(), time_s + 1e-9,
                                      [](double time, const auto& entry) { return time < entry.first; });
  return after == states_.begin() ? &states_.front().second : &std::prev(after)->second;
}

/// White noise with the densities of AirSim's keys (angle and velocity random walks), at the physics rate; the
/// accelerometer measures specific force.
ImuData read_imu(const ImuSettings& settings, const SensorContext& now, SensorNoiseState& noise) {
  NormalGenerator normals(noise.seed, now.time_ns);
  const double elapsed = elapsed_s(noise, now.time_s);
  const double per_sample = 1.0 / std::sqrt(SimulationClock::kStep_s);
  const double gyro_white = radians(settings.angular_random_walk_deg_sqrt_h) / std::sqrt(kHour_s) * per_sample;
  const double accel_white = settings.velocity_random_walk_m_s_sqrt_h / std::sqrt(kHour_s) * per_sample;
  const Vec3 gyro_bias = bias3(noise, 0, radians(settings.gyro_bias_stability_deg_h) / kHour_s,
                               settings.gyro_bias_tau_s, elapsed, normals);
  const Vec3 accel_bias = bias3(noise, 3, settings.accel_bias_stability_ug * kMicroGravity_m_s2,
                                settings.accel_bias_tau_s, elapsed, normals);
  const VehicleState& state = now.vehicle.state();
  const Vec3 gravity(0.0, 0.0, vehicle::kStandardGravity_m_s2);
  const Vec3 force = state.T_ned_body.rotation.conjugate() * (state.acceleration_m_s2 - gravity);
  ImuData data;
  data.time_stamp = now.time_ns;
  data.orientation = to_airsim(state.T_ned_body.rotation);
  data.angular_velocity = to_airsim(Vec3(state.angular_velocity_rad_s + gyro_bias + gyro_white * normals.next3()));
  data.linear_acceleration = to_airsim(Vec3(force + accel_bias + accel_white * normals.next3()));
  return data;
}

BarometerData read_barometer(const BarometerSettings& settings, const SensorContext& now, SensorNoiseState& noise) {
  const DelayedState reading = delayed_state(settings.timing, now);
  NormalGenerator normals(noise.seed, reading.time_ns);
  const double decay = std::exp(-elapsed_s(noise, reading.time_s) / settings.pressure_factor_tau_s);
  double& factor = noise.biases[0];
  factor = sensors::gauss_markov_step(factor, settings.pressure_factor_sigma, decay, normals.next());
  const double height_m = now.geodetic_frame.to_geodetic(reading.state.T_ned_body.translation).height.m;
  const double true_pa = sensors::Atmosphere{}.pressure_pa(clamp_atmosphere_height_m(height_m));
  const double pressure_pa = true_pa * (1.0 + factor) + settings.noise_sigma_pa * normals.next();
  sensors::Atmosphere standard;
  standard.sea_level_pressure_pa = 100.0 * settings.qnh_hpa;
  BarometerData data;
  data.time_stamp = reading.time_ns;
  data.pressure = static_cast<float>(pressure_pa);
  data.altitude = static_cast<float>(standard.height_m(pressure_pa));
  data.qnh = static_cast<float>(settings.qnh_hpa);
  return data;
}

MagnetometerData read_magnetometer(const MagnetometerSettings& settings, const SensorContext& now,
                                   SensorNoiseState& noise) {
  const DelayedState reading = delayed_state(settings.timing, now);
  NormalGenerator normals(noise.seed, reading.time_ns);
  const Vec3 field = reading.state.T_ned_body.rotation.conjugate() * now.geodetic_frame.magnetic_field_ned_gauss;
  MagnetometerData data;
  data.time_stamp = reading.time_ns;
  data.magnetic_field_body = to_airsim(Vec3(settings.scale_factor * field + Vec3::Constant(settings.bias_gauss) +
                                            settings.noise_sigma_gauss * normals.next3()));
  return data;
}

GpsData read_gps(const GpsSettings& settings, const SensorContext& now, SensorNoiseState& /*noise*/) {
  const DelayedState reading = delayed_state(settings.timing, now);
  const auto settled = [&](double initial, double last, double tau_s) {
    return now.moving ? last + (initial - last) * std::exp(-reading.time_s / tau_s) : last;
  };
  const double eph = settled(settings.eph_initial, settings.eph_final, settings.eph_tau_s);
  GpsData data;
  data.time_stamp = reading.time_ns;
  data.is_valid = !now.moving || now.time_s >= settings.timing.startup_delay_s;
  if (!data.is_valid) return data;
  data.gnss.geo_point = now.geodetic_frame.to_geo_point(reading.state.T_ned_body.translation);
  data.gnss.eph = static_cast<float>(eph);
  data.gnss.epv = static_cast<float>(settled(settings.epv_initial, settings.epv_final, settings.epv_tau_s));
  data.gnss.velocity = to_airsim(reading.state.velocity_m_s);
  data.gnss.fix_type = eph <= settings.eph_min_3d ? 3 : eph <= settings.eph_min_2d ? 2 : 0;
  data.gnss.time_utc = reading.time_ns / 1000;
  return data;
}

DistanceSensorData read_distance(const DistanceSensorSettings& settings, const SensorContext& now, double distance_m,
                                 SensorNoiseState& noise) {
  NormalGenerator normals(noise.seed, now.time_ns);
  const double measured = std::min(distance_m, settings.max_m) + settings.noise_sigma_m * normals.next();
  DistanceSensorData data;
  data.time_stamp = now.time_ns;
  data.distance = static_cast<float>(std::clamp(measured, settings.min_m, settings.max_m));
  data.min_distance = static_cast<float>(settings.min_m);
  data.max_distance = static_cast<float>(settings.max_m);
  data.relative_pose = to_airsim(settings.T_body_sensor);
  return data;
}

}  // namespace tileflight::simulator
