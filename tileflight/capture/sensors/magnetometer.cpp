#include "tileflight/capture/sensors/magnetometer.h"

#include "tileflight/capture/flight_path/path.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/random_numbers.h"

namespace tileflight::sensors {
namespace {

using geometry::SE3;
using geometry::Vec3;

constexpr std::uint64_t kMagnetometerNoise = 31;

}  // namespace

void check(const MagnetometerOptions& options) {
  if (!(options.noise_ut >= 0.0)) throw InputError("magnetometer noise", "must be 0 or more");
  if (!options.hard_iron_ut.allFinite() || !options.soft_iron.allFinite())
    throw InputError("magnetometer hard_iron", "and soft_iron must be finite");
}

std::vector<MagnetometerSample> simulate_magnetometer(const std::function<SE3(double)>& T_local_camera_at,
                                                      const std::function<Vec3(const Vec3&)>& field_at, double start_s,
                                                      double end_s, const MagnetometerOptions& options) {
  const flight_path::SampleTimes times =
      flight_path::make_sample_times("magnetometer", start_s, end_s, options.rate_hz);
  check(options);
  const std::uint64_t key = base::stream_key(options.seed, kMagnetometerNoise);
  std::vector<MagnetometerSample> samples;
  samples.reserve(times.count());
  for (std::uint64_t i = 0; i < times.count(); ++i) {
    const SE3 T_local_sensor = T_local_camera_at(times.at(i)) * options.T_camera_sensor;
    const Vec3 field = T_local_sensor.rotation.conjugate() * field_at(T_local_sensor.translation);
    const std::array<float, 4> n = base::normal_variates(key, i);
    samples.push_back(
        {times.at(i), options.soft_iron * field + options.hard_iron_ut + options.noise_ut * Vec3(n[0], n[1], n[2])});
  }
  return samples;
}

}  // namespace tileflight::sensors
