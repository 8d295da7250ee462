#include "tileflight/capture/sensors/barometer.h"

#include <cmath>

#include "tileflight/capture/flight_path/path.h"
#include "tileflight/capture/sensors/gauss_markov.h"
#include "tileflight/core/base/input_error.h"

namespace tileflight::sensors {
namespace {

constexpr std::uint64_t kBarometerNoise = 21, kDriftStream = 22;

// U.S. Standard Atmosphere 1976, tables 1 to 4.
constexpr double kGravity_m_s2 = 9.80665;
constexpr double kMolarMass_kg_mol = 0.0289644;
constexpr double kGasConstant_j_mol_k = 8.31432;
constexpr double kLapse_k_m = 0.0065;
constexpr double kEarthRadius_m = 6356766.0;
constexpr double kExponent = kGravity_m_s2 * kMolarMass_kg_mol / (kGasConstant_j_mol_k * kLapse_k_m);
constexpr double kLowest_m = -5000.0, kHighest_m = 11000.0;

/// Geopotential height, in which gravity is constant (U.S. Standard Atmosphere 1976, (18)), and its inverse.
double geopotential_m(double height_m) { return kEarthRadius_m * height_m / (kEarthRadius_m + height_m); }
double geometric_m(double geopotential_m) {
  return kEarthRadius_m * geopotential_m / (kEarthRadius_m - geopotential_m);
}

}  // namespace

void check(const BarometerOptions& options) {
  if (!(options.atmosphere.sea_level_pressure_pa > 0.0))
    throw InputError("barometer sea_level_pressure", "must be more than 0");
  if (!(options.atmosphere.sea_level_temperature_k > 150.0))
    throw InputError("barometer sea_level_temperature", "must be more than 150 K");
  if (!(options.noise_pa >= 0.0 && options.drift_pa >= 0.0))
    throw InputError("barometer noise", "and drift must be 0 or more");
  if (!(options.drift_time_s > 0.0)) throw InputError("barometer drift_time", "must be more than 0");
}

double Atmosphere::temperature_k(double height_m) const {
  return sea_level_temperature_k - kLapse_k_m * geopotential_m(height_m);
}

/// U.S. Standard Atmosphere 1976, (33a).
double Atmosphere::pressure_pa(double height_m) const {
  return sea_level_pressure_pa * std::pow(temperature_k(height_m) / sea_level_temperature_k, kExponent);
}

double Atmosphere::height_m(double pressure_pa) const {
  const double warmth = std::pow(pressure_pa / sea_level_pressure_pa, 1.0 / kExponent);
  return geometric_m(sea_level_temperature_k * (1.0 - warmth) / kLapse_k_m);
}

std::vector<BarometerSample> simulate_barometer(const std::function<double(double)>& height_at, double start_s,
                                                double end_s, const BarometerOptions& options) {
  const flight_path::SampleTimes times = flight_path::make_sample_times("barometer", start_s, end_s, options.rate_hz);
  check(options);
  const std::uint64_t noise_key = base::stream_key(options.seed, kBarometerNoise);
  GaussMarkov drift(options.drift_pa, options.drift_time_s, options.rate_hz,
                    base::stream_key(options.seed, kDriftStream));
  std::vector<BarometerSample> samples;
  samples.reserve(times.count());
  for (std::uint64_t i = 0; i < times.count(); ++i, drift.step()) {
    const double time_s = times.at(i), height_m = height_at(time_s);
    if (!(height_m >= kLowest_m && height_m <= kHighest_m))
      throw InputError("barometer", "the flight must stay between 5 km below and 11 km above sea level");
    const double error_pa = drift.value() + options.noise_pa * base::normal_variates(noise_key, i)[0];
    const double pressure_pa = options.atmosphere.pressure_pa(height_m) + error_pa;
    samples.push_back(
        {time_s, pressure_pa, options.atmosphere.temperature_k(height_m), Atmosphere{}.height_m(pressure_pa)});
  }
  return samples;
}

}  // namespace tileflight::sensors
