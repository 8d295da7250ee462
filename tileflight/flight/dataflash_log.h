#pragma once

#include <filesystem>
#include <vector>

#include "tileflight/flight/telemetry.h"

namespace tileflight::flight {

/// What a range finder that looks down said.
struct RangeReading {
  double time_s = 0.0;  ///< on the clock of read_dataflash's positions
  double range_m = 0.0;
};

/// The range finder (RFND) that looks down, its good readings alone; of the lowest instance. Empty where the log has
/// none. Throws InputError as read_dataflash does.
std::vector<RangeReading> read_dataflash_ranges(const std::filesystem::path& file);

/// ArduPilot's log (.bin): the positions of one receiver (GPS: the lowest instance with a three-dimensional fix), or
/// where there are none the estimator's (POS, else XKF1 or NKF1 of the lowest core about ORGN); seconds from the first.
/// Heights are the receiver's above the ellipsoid where every fix has one (GPA's AEl), else above sea level; above
/// take-off they are POS's above home, else the barometer's. The attitude is that of ATT (else XKF1, NKF1, AHR2) next
/// in time, at most 0.2 s away; turning rates are IMU's, of the lowest instance. UTC comes from the receiver's week.
/// Throws InputError (file, cause) when it is no such log or holds no position.
Telemetry read_dataflash(const std::filesystem::path& file);

}  // namespace tileflight::flight
