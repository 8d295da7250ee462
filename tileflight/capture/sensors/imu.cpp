#include "tileflight/capture/sensors/imu.h"

#include <cmath>

#include "tileflight/capture/flight_path/path.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/random_numbers.h"
#include "tileflight/core/geometry/transform.h"

namespace tileflight::sensors {

using geometry::Vec3;

MotionFunction motion_along(const flight_path::Path& path) {
  return [path](double time_s) {
    return Motion{path.pose(time_s), path.velocity(time_s), path.acceleration(time_s), path.angular_velocity(time_s),
                  path.angular_acceleration(time_s)};
  };
}

Motion rigidly_attached_motion(const Motion& body, const geometry::SE3& T_body_sensor) {
  const Eigen::Quaterniond& R_local_body = body.T_local_body.rotation;
  const Eigen::Quaterniond R_sensor_body = T_body_sensor.rotation.conjugate();
  const Vec3 &arm = T_body_sensor.translation, &w = body.angular_velocity;
  return {body.T_local_body * T_body_sensor, body.velocity + R_local_body * w.cross(arm),
          body.acceleration + R_local_body * (body.angular_acceleration.cross(arm) + w.cross(w.cross(arm))),
          R_sensor_body * w, R_sensor_body * body.angular_acceleration};
}

namespace {

using geometry::Vec3;

constexpr std::uint64_t kGyroscopeNoise = 11, kAccelerometerNoise = 12, kGyroscopeWalk = 13, kAccelerometerWalk = 14;
using geometry::kRadiansPerDegree;

void check_not_negative(double value, const char* option) {
  if (!(value >= 0.0 && std::isfinite(value))) throw InputError(std::string("IMU ") + option, "must be 0 or more");
}

/// Independent standard normal vectors, addressed by index.
class NormalVectors {
 public:
  NormalVectors(std::uint64_t seed, std::uint64_t stream) : key_(base::stream_key(seed, stream)) {}
  Vec3 at(std::uint64_t i) const {
    const std::array<float, 4> n = base::normal_variates(key_, i);
    return {n[0], n[1], n[2]};
  }

 private:
  std::uint64_t key_;
};

Vec3 saturate(const Vec3& value, double range) { return value.cwiseMax(-range).cwiseMin(range); }

/// Error-free sample: the angular rate, and the acceleration minus gravity, in the unit's axes.
geometry::ImuSample ideal_sample(const Motion& imu, double time_s, double gravity_m_s2) {
  const Vec3 felt = imu.acceleration + gravity_m_s2 * Vec3::UnitZ();
  return {time_s, imu.angular_velocity, imu.T_local_body.rotation.conjugate() * felt};
}

}  // namespace

void check(const ImuOptions& options) {
  check_not_negative(options.accelerometer_noise_density, "accelerometer_noise_density");
  check_not_negative(options.accelerometer_random_walk, "accelerometer_random_walk");
  check_not_negative(options.gyroscope_noise_density, "gyroscope_noise_density");
  check_not_negative(options.gyroscope_random_walk, "gyroscope_random_walk");
  if (!(options.accelerometer_range_m_s2 > 0.0)) throw InputError("IMU accelerometer_range", "must be more than 0");
  if (!(options.gyroscope_range_rad_s > 0.0)) throw InputError("IMU gyroscope_range", "must be more than 0");
  if (!options.accelerometer_bias.allFinite() || !options.gyroscope_bias.allFinite())
    throw InputError("IMU bias", "must be finite");
}

ImuOptions imu_preset(const std::string& name) {
  ImuOptions options;
  if (name == "adis16448") return options;
  if (name == "bmi160") {
    options.accelerometer_noise_density = 2.8e-3;
    options.accelerometer_random_walk = 8.6e-4;
    options.gyroscope_noise_density = 1.6e-4;
    options.gyroscope_random_walk = 2.2e-5;
    options.accelerometer_range_m_s2 = 16.0 * 9.80665;
    options.gyroscope_range_rad_s = 2000.0 * kRadiansPerDegree;
    return options;
  }
  if (name == "perfect") {
    options.accelerometer_noise_density = options.accelerometer_random_walk = 0.0;
    options.gyroscope_noise_density = options.gyroscope_random_walk = 0.0;
    options.accelerometer_range_m_s2 = options.gyroscope_range_rad_s = std::numeric_limits<double>::infinity();
    return options;
  }
  throw InputError("IMU '" + name + "'", "is unknown; use adis16448, bmi160 or perfect");
}

ImuRecording simulate_imu(const MotionFunction& camera, double start_s, double end_s, const ImuOptions& options) {
  const flight_path::SampleTimes times = flight_path::make_sample_times("IMU", start_s, end_s, options.rate_hz);
  check(options);
  const NormalVectors gyroscope_noise(options.seed, kGyroscopeNoise), gyroscope_walk(options.seed, kGyroscopeWalk);
  const NormalVectors accelerometer_noise(options.seed, kAccelerometerNoise);
  const NormalVectors accelerometer_walk(options.seed, kAccelerometerWalk);
  const double per_sample = std::sqrt(options.rate_hz);
  ImuRecording recording;
  recording.samples.reserve(times.count());
  recording.biases.reserve(times.count());
  geometry::ImuBias bias{options.gyroscope_bias, options.accelerometer_bias};
  for (std::uint64_t i = 0; i < times.count(); ++i) {
    const double time_s = times.at(i);
    geometry::ImuSample sample =
        ideal_sample(rigidly_attached_motion(camera(time_s), options.T_camera_imu), time_s, options.gravity_m_s2);
    const Vec3 rate = options.gyroscope_scale_misalignment * sample.angular_rate_rad_s + bias.gyroscope_rad_s +
                      options.gyroscope_noise_density * per_sample * gyroscope_noise.at(i);
    const Vec3 force = options.accelerometer_scale_misalignment * sample.specific_force_m_s2 + bias.accelerometer_m_s2 +
                       options.accelerometer_noise_density * per_sample * accelerometer_noise.at(i);
    sample.angular_rate_rad_s = saturate(rate, options.gyroscope_range_rad_s);
    sample.specific_force_m_s2 = saturate(force, options.accelerometer_range_m_s2);
    recording.samples.push_back(sample);
    recording.biases.push_back(bias);
    bias.gyroscope_rad_s += options.gyroscope_random_walk / per_sample * gyroscope_walk.at(i);
    bias.accelerometer_m_s2 += options.accelerometer_random_walk / per_sample * accelerometer_walk.at(i);
  }
  return recording;
}

}  // namespace tileflight::sensors
