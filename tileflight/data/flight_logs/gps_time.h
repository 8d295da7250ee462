#pragma once

namespace tileflight::flight_logs {

/// Converts GPS time (whole weeks since 6 January 1980 and seconds of the week) to UTC as Unix time, seconds since 1970
/// without leap seconds. IS-GPS-200, 3.3.4; leap seconds up to the one at the end of 2016 (IERS Bulletin C: none has
/// been announced since).
double utc_from_gps_s(double week, double seconds_of_week);

}  // namespace tileflight::flight_logs
