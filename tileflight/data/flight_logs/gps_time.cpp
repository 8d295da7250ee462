#include "tileflight/data/flight_logs/gps_time.h"

#include <chrono>

namespace tileflight::flight_logs {
namespace {

using std::chrono::sys_days;
using std::chrono::year;

constexpr double kSecondsPerDay = 86400.0;

constexpr double seconds_of(sys_days day) { return kSecondsPerDay * day.time_since_epoch().count(); }

constexpr double kGpsEpoch_s = seconds_of(year(1980) / 1 / 6);

/// Days that started one second later because of a leap second, since the GPS epoch.
constexpr double kAfterLeapSecond_s[] = {
    seconds_of(year(1981) / 7 / 1), seconds_of(year(1982) / 7 / 1), seconds_of(year(1983) / 7 / 1),
    seconds_of(year(1985) / 7 / 1), seconds_of(year(1988) / 1 / 1), seconds_of(year(1990) / 1 / 1),
    seconds_of(year(1991) / 1 / 1), seconds_of(year(1992) / 7 / 1), seconds_of(year(1993) / 7 / 1),
    seconds_of(year(1994) / 7 / 1), seconds_of(year(1996) / 1 / 1), seconds_of(year(1997) / 7 / 1),
    seconds_of(year(1999) / 1 / 1), seconds_of(year(2006) / 1 / 1), seconds_of(year(2009) / 1 / 1),
    seconds_of(year(2012) / 7 / 1), seconds_of(year(2015) / 7 / 1), seconds_of(year(2017) / 1 / 1),
};

}  // namespace

double utc_from_gps_s(double week, double seconds_of_week) {
  const double gps_s = kGpsEpoch_s + 7.0 * kSecondsPerDay * week + seconds_of_week;
  double leap_s = 0.0;
  for (const double day_s : kAfterLeapSecond_s) leap_s += gps_s - (leap_s + 1.0) >= day_s ? 1.0 : 0.0;
  return gps_s - leap_s;
}

}  // namespace tileflight::flight_logs
