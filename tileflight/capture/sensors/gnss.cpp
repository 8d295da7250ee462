#include "tileflight/capture/sensors/gnss.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/random_numbers.h"

namespace tileflight::sensors {
namespace {

using geometry::Vec3;

constexpr std::uint64_t kGnssNoise = 1;
constexpr std::uint64_t kBiasStream = 2;

void check(const GnssOptions& options, double start_s, double end_s) {
  base::require(options.rate_hz > 0.0 && options.rate_hz <= 1000.0, "GNSS rate", "must lie between 0 and 1000 Hz");
  base::require(options.horizontal_sigma_m >= 0.0 && options.vertical_sigma_m >= 0.0, "GNSS noise",
                "must not be negative");
  base::require(options.horizontal_bias_sigma_m >= 0.0 && options.vertical_bias_sigma_m >= 0.0, "GNSS bias",
                "must not be negative");
  base::require(options.bias_time_s > 0.0, "GNSS bias time", "must be positive");
  base::require(std::isfinite(options.lag_s), "GNSS lag", "must be finite");
  base::require(start_s <= end_s && std::isfinite(end_s - start_s), "GNSS time span", "ends before it starts");
}

Vec3 normal_vector(std::uint64_t key, std::uint64_t counter) {
  const std::array<float, 4> n = base::normal_variates(key, counter);
  return {n[0], n[1], n[2]};
}

}  // namespace

std::vector<GnssFix> simulate_gnss(const std::function<Vec3(double)>& position_at, double start_s, double end_s,
                                   const GnssOptions& options) {
  check(options, start_s, end_s);
  const Vec3 noise_sigma(options.horizontal_sigma_m, options.horizontal_sigma_m, options.vertical_sigma_m);
  const Vec3 bias_sigma(options.horizontal_bias_sigma_m, options.horizontal_bias_sigma_m,
                        options.vertical_bias_sigma_m);
  // Exactly discretized Gauss-Markov process, started in its stationary distribution.
  const double kept = std::exp(-1.0 / (options.rate_hz * options.bias_time_s));
  const double fresh = std::sqrt(1.0 - kept * kept);
  const std::uint64_t noise_key = base::stream_key(options.seed, kGnssNoise);
  const std::uint64_t bias_key = base::stream_key(options.seed, kBiasStream);
  const auto count = static_cast<std::uint64_t>((end_s - start_s) * options.rate_hz + 1e-6) + 1;
  std::vector<GnssFix> fixes;
  fixes.reserve(count);
  Vec3 bias = bias_sigma.cwiseProduct(normal_vector(bias_key, 0));
  for (std::uint64_t i = 0; i < count; ++i) {
    const double time_s = std::min(end_s, start_s + static_cast<double>(i) / options.rate_hz);
    const Vec3 noise = noise_sigma.cwiseProduct(normal_vector(noise_key, i));
    fixes.push_back({time_s, position_at(time_s - options.lag_s) + bias + noise,
                     std::hypot(noise_sigma.x(), bias_sigma.x()), std::hypot(noise_sigma.z(), bias_sigma.z())});
    bias = kept * bias + fresh * bias_sigma.cwiseProduct(normal_vector(bias_key, i + 1));
  }
  return fixes;
}

std::vector<GnssFix> simulate_gnss(const geometry::Trajectory& trajectory, const GnssOptions& options) {
  if (trajectory.empty()) throw InputError("GNSS", "the trajectory has no poses");
  const double start_s = trajectory.poses.front().time_s;
  const double end_s = trajectory.poses.back().time_s;
  const auto position_at = [&](double time_s) {
    return geometry::interpolate(trajectory, std::clamp(time_s, start_s, end_s))->translation;
  };
  return simulate_gnss(position_at, start_s, end_s, options);
}

}  // namespace tileflight::sensors
