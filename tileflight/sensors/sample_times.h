#pragma once

#include <cstdint>

namespace tileflight::sensors {

/// The moments at which a sensor is read: start, start + 1 / rate, ... up to end.
struct SampleTimes {
  double start_s = 0.0, end_s = 0.0, rate_hz = 1.0;

  std::uint64_t count() const { return static_cast<std::uint64_t>((end_s - start_s) * rate_hz + 1e-6) + 1; }
  double at(std::uint64_t i) const { return start_s + static_cast<double>(i) / rate_hz; }
};

/// Throws InputError (sensor, cause) for a rate that is not above 0 and at most 100 kHz, or an end before the start.
SampleTimes sample_times(const char* sensor, double start_s, double end_s, double rate_hz);

}  // namespace tileflight::sensors
