#pragma once

namespace tileflight::flight {

/// Seconds since 1970 in UTC (leap seconds not counted, as Unix has it) of a time that a GPS receiver tells as whole
/// weeks since 6 January 1980 and seconds of the week. IS-GPS-200, 3.3.4; leap seconds up to the one of the end of 2016
/// (IERS Bulletin C: none was announced since).
double utc_from_gps_s(double week, double seconds_of_week);

}  // namespace tileflight::flight
