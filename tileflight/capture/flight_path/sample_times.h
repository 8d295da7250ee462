#pragma once

#include <cstdint>

namespace tileflight::flight_path {

/// Sampling times of a sensor: start, start + 1 / rate, ... up to end.
struct SampleTimes {
  double start_s = 0.0, end_s = 0.0, rate_hz = 1.0;

  std::uint64_t count() const { return static_cast<std::uint64_t>((end_s - start_s) * rate_hz + 1e-6) + 1; }
  double at(std::uint64_t i) const { return start_s + static_cast<double>(i) / rate_hz; }
};

/// Throws InputError (sensor, cause) unless the rate is above 0 and at most 100 kHz and the end is not before the
/// start.
SampleTimes make_sample_times(const char* sensor, double start_s, double end_s, double rate_hz);

}  // namespace tileflight::flight_path
