#pragma once

#include <filesystem>
#include <vector>

#include "tileflight/data/flight_logs/telemetry.h"

namespace tileflight::flight_logs {

/// Converts GPS time (whole weeks since 6 January 1980 and seconds of the week) to UTC as Unix time, seconds since 1970
/// without leap seconds. IS-GPS-200, 3.3.4; leap seconds up to the one at the end of 2016 (IERS Bulletin C: none has
/// been announced since).
double utc_from_gps_s(double week, double seconds_of_week);

/// A measurement of a downward-looking range finder.
struct RangeReading {
  double time_s = 0.0;  ///< on the clock of read_dataflash's positions
  double range_m = 0.0;
};

/// Valid readings of the downward-looking range finder (RFND) with the lowest instance number. Empty if the log has
/// none. Throws InputError as read_dataflash does.
std::vector<RangeReading> read_dataflash_ranges(const std::filesystem::path& file);

/// Reads ArduPilot's log (.bin). Positions are those of one receiver (GPS: the lowest instance with a 3D fix), or if
/// there are none those of the estimator (POS, else XKF1 or NKF1 of the lowest core, relative to ORGN); times are
/// seconds from the first. Heights are the receiver's above the ellipsoid if every fix has one (GPA's AEl), else above
/// sea level; heights above take-off are POS's above home, else the barometer's. The attitude is the nearest in time of
/// ATT (else XKF1, NKF1, AHR2), at most 0.2 s away; angular rates are those of IMU, lowest instance. UTC comes from the
/// receiver's GPS week. Throws InputError (file, cause) if the file is not such a log or holds no position.
Telemetry read_dataflash(const std::filesystem::path& file);

}  // namespace tileflight::flight_logs
