#pragma once

#include <cmath>
#include <cstdint>
#include <string>

#include "tileflight/core/base/input_error.h"

namespace tileflight::geometry {

inline constexpr std::int64_t kNanosecondsPerSecond = 1'000'000'000;

/// Converts whole nanoseconds to seconds. Whole seconds and the rest are converted apart, so that the nearest double
/// results: to_nanoseconds() and back is exact, also for dates of this century.
inline double to_seconds(std::int64_t nanoseconds) {
  return static_cast<double>(nanoseconds / kNanosecondsPerSecond) +
         static_cast<double>(nanoseconds % kNanosecondsPerSecond) / 1e9;  // 1e-9 is no double
}

/// Converts seconds to whole nanoseconds that to_seconds() maps back to the same time: the rounded product, as in
/// EuRoC's files, where it does so, else the nearest number that does. Throws InputError for times of more than 292
/// years.
inline std::int64_t to_nanoseconds(double time_s) {
  constexpr double kMost_s = 9.2e9;
  if (!(std::abs(time_s) < kMost_s))
    throw InputError("time", std::to_string(time_s) + " s is too large for a file with times in nanoseconds");
  if (const std::int64_t rounded = std::llround(1e9 * time_s); to_seconds(rounded) == time_s) return rounded;
  const double whole = std::floor(time_s);
  return static_cast<std::int64_t>(whole) * kNanosecondsPerSecond + std::llround(1e9 * (time_s - whole));
}

}  // namespace tileflight::geometry
