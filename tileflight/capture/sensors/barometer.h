#pragma once

#include <cstdint>
#include <functional>
#include <vector>

namespace tileflight::sensors {

/// The lowest layer of the standard atmosphere (ISO 2533; U.S. Standard Atmosphere 1976), up to 11 km above sea level.
/// Weather is modelled by another pressure and temperature at sea level.
struct Atmosphere {
  double sea_level_pressure_pa = 101325.0;
  double sea_level_temperature_k = 288.15;

  /// Pressure and temperature at a height above mean sea level, metres (-5000 to 11000).
  double pressure_pa(double height_m) const;
  double temperature_k(double height_m) const;
  /// The height above mean sea level at which the pressure occurs.
  double height_m(double pressure_pa) const;
};

/// A barometer's errors. Noise: resolution of TE's MS5611 at its highest oversampling (data sheet: 0.012 mbar RMS). The
/// drift models weather, temperature and the airflow around the body; no data sheet states it.
struct BarometerOptions {
  std::uint64_t seed = 1;
  double rate_hz = 50.0;
  Atmosphere atmosphere;
  double noise_pa = 1.2;
  double drift_pa = 12.0;       ///< standard deviation; corresponds to about a metre
  double drift_time_s = 600.0;  ///< correlation time of the drift
};

/// Throws InputError for options out of range.
void check(const BarometerOptions& options);

/// A barometer reading.
struct BarometerSample {
  double time_s = 0.0;
  double pressure_pa = 0.0;
  double temperature_k = 0.0;  ///< of the air, without errors
  double altitude_m = 0.0;     ///< above sea level, by the standard atmosphere (15 degrees C, 1013.25 hPa)
};

/// Simulates samples at start, start + 1 / rate, ... up to end; `height_at` returns the height above mean sea level,
/// metres. Throws InputError for options or heights out of range.
std::vector<BarometerSample> simulate_barometer(const std::function<double(double time_s)>& height_at, double start_s,
                                                double end_s, const BarometerOptions& options = {});

}  // namespace tileflight::sensors
