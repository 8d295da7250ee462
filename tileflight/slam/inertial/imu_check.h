#pragma once

// Checks of an inertial unit's readings: units, gaps, values that are stuck or saturated.

#include <string>
#include <vector>

#include "tileflight/core/base/warning.h"
#include "tileflight/slam/inertial/imu_samples.h"

namespace tileflight::inertial {

/// A part of the recording without usable readings.
struct UnusableSpan {
  double from_s = 0.0, to_s = 0.0;  ///< the last good reading before it, the first one after it
};

/// Result of check_readings().
struct ImuCheck {
  double rate_hz = 0.0;                ///< of the median interval
  std::vector<UnusableSpan> unusable;  ///< in order of time
  Warnings warnings;                   ///< what was found and left out, one for each kind

  /// Returns whether the readings from `from_s` to `to_s` have no unusable span.
  bool covers(double from_s, double to_s) const;
};

/// Finds gaps (an interval over three times the median), readings that repeat themselves for a tenth of a second,
/// and saturated axes; the latter two only if the unit has noise. `where` names the readings. Throws InputError for
/// readings that no estimate can rest on: fewer than two, not finite, times that do not increase, a specific force in g
/// or without gravity, a unit that never changes.
ImuCheck check_readings(const std::vector<geometry::ImuSample>& samples, const ImuNoise& noise,
                        const std::string& where);

}  // namespace tileflight::inertial
