#include "tileflight/capture/flight_path/sample_times.h"

#include <cmath>
#include <string>

#include "tileflight/core/base/input_error.h"

namespace tileflight::flight_path {

SampleTimes make_sample_times(const char* sensor, double start_s, double end_s, double rate_hz) {
  constexpr double kHighestRate_hz = 1e5;
  if (!(rate_hz > 0.0 && rate_hz <= kHighestRate_hz))
    throw InputError(std::string(sensor) + " rate", "must lie between 0 and 100000 Hz");
  if (!(start_s <= end_s && std::isfinite(end_s - start_s)))
    throw InputError(std::string(sensor) + " time span", "ends before it starts");
  return {start_s, end_s, rate_hz};
}

}  // namespace tileflight::flight_path
