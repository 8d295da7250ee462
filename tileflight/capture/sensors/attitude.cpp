#include "tileflight/capture/sensors/attitude.h"

#include <cmath>
#include <numbers>

#include "tileflight/capture/sensors/gauss_markov.h"
#include "tileflight/core/base/input_error.h"

namespace tileflight::sensors {
namespace {

constexpr double kRadiansOfDegree = std::numbers::pi / 180.0;
constexpr std::uint64_t kAttitudeNoise = 1, kEastStream = 2, kNorthStream = 3, kUpStream = 4;

}  // namespace

void check(const AttitudeOptions& o) {
  base::require(o.rate_hz > 0.0 && o.rate_hz <= 1e5, "attitude rate_hz", "must lie between 0 and 100000");
  base::require(o.noise_deg >= 0.0 && o.tilt_bias_sigma_deg >= 0.0 && o.yaw_bias_sigma_deg >= 0.0, "attitude errors",
                "must not be negative");
  base::require(o.bias_time_s > 0.0, "attitude bias_time_s", "must be more than 0");
}

std::vector<AttitudeSample> simulate_attitude(const std::function<geometry::SE3(double)>& pose_at,
                                              const flight_path::SampleTimes& times, const AttitudeOptions& options) {
  check(options);
  const auto bias = [&](double sigma_deg, std::uint64_t stream) {
    return GaussMarkov(sigma_deg * kRadiansOfDegree, options.bias_time_s, times.rate_hz,
                       base::stream_key(options.seed, stream));
  };
  GaussMarkov east = bias(options.tilt_bias_sigma_deg, kEastStream);
  GaussMarkov north = bias(options.tilt_bias_sigma_deg, kNorthStream);
  GaussMarkov up = bias(options.yaw_bias_sigma_deg, kUpStream);
  const std::uint64_t noise_key = base::stream_key(options.seed, kAttitudeNoise);
  std::vector<AttitudeSample> samples;
  samples.reserve(times.count());
  for (std::uint64_t i = 0; i < times.count(); ++i) {
    const auto n = base::normal_variates(noise_key, i);
    const geometry::Vec3 error = geometry::Vec3(east.value(), north.value(), up.value()) +
                                 options.noise_deg * kRadiansOfDegree * geometry::Vec3(n[0], n[1], n[2]);
    samples.push_back({times.at(i), geometry::so3_exp(error) * pose_at(times.at(i)).rotation});
    east.step(), north.step(), up.step();
  }
  return samples;
}

double tilt_sigma_deg(const AttitudeOptions& o) {
  return std::max(0.01, std::hypot(o.tilt_bias_sigma_deg, o.noise_deg));
}
double yaw_sigma_deg(const AttitudeOptions& o) { return std::max(0.01, std::hypot(o.yaw_bias_sigma_deg, o.noise_deg)); }

}  // namespace tileflight::sensors
