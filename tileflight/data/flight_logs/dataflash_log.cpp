#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>
#include <numbers>

#include "tileflight/core/base/files.h"
#include "tileflight/core/base/text_parsing.h"
#include "tileflight/data/flight_logs/dataflash_messages.h"
#include "tileflight/data/flight_logs/fix_filter.h"
#include "tileflight/data/flight_logs/telemetry.h"

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

namespace {

constexpr double kFarthest_s = 0.2;
constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
constexpr double kThreeDimensionalFix = 3;
/// AEl is the lowest 32-bit number (in centimetres) if the receiver does not know it.
constexpr double kMinHeight_m = -1e6;

using FieldsByMessage = std::map<std::string, std::vector<DataflashField>>;

std::vector<DataflashField> attitude_fields() {
  return {{"TimeUS", 1e-6}, {"TimeMS", 1e-3}, {"Yaw", 1.0, "deg"}, {"Pitch", 1.0, "deg"}, {"Roll", 1.0, "deg"}};
}

/// Fields of the extended Kalman filters: attitude, and metres north, east and down of the origin (ORGN).
std::vector<DataflashField> estimator_fields() {
  return {{"TimeUS", 1e-6}, {"TimeMS", 1e-3}, {"C"}, {"Yaw", 1.0, "deg"}, {"Pitch", 1.0, "deg"}, {"Roll", 1.0, "deg"},
          {"PN"},           {"PE"},           {"PD"}};
}

/// Logs up to 2014 use milliseconds since the start: T in a receiver's messages, whose TimeMS is that of the week, and
/// TimeMS in others.
const FieldsByMessage& requested_messages() {
  static const FieldsByMessage requested = {
      {"GPS",
       {{"TimeUS", 1e-6},
        {"T", 1e-3},
        {"I"},
        {"Status"},
        {"Lat"},
        {"Lng"},
        {"Alt"},
        {"GWk"},
        {"Week"},
        {"GMS", 1e-3},
        {"TimeMS", 1e-3}}},
      {"GPA", {{"TimeUS", 1e-6}, {"I"}, {"AEl"}}},
      {"POS", {{"TimeUS", 1e-6}, {"Lat"}, {"Lng"}, {"Alt"}, {"RelHomeAlt"}}},
      {"BARO", {{"TimeUS", 1e-6}, {"TimeMS", 1e-3}, {"I"}, {"Alt"}}},
      {"ATT", attitude_fields()},
      {"AHR2", attitude_fields()},
      {"XKF1", estimator_fields()},
      {"NKF1", estimator_fields()},
      {"ORGN", {{"TimeUS", 1e-6}, {"Type"}, {"Lat"}, {"Lng"}, {"Alt"}}},
      {"RFND", {{"TimeUS", 1e-6}, {"Instance"}, {"I"}, {"Stat"}, {"Orient"}, {"Dist"}}},
      {"IMU",
       {{"TimeUS", 1e-6},
        {"TimeMS", 1e-3},
        {"I"},
        {"GyrX", 1.0, "rad/s"},
        {"GyrY", 1.0, "rad/s"},
        {"GyrZ", 1.0, "rad/s"}}},
  };
  return requested;
}

double first_known(double first, double second) { return std::isnan(first) ? second : first; }

/// Rows of a time (one of two fields) and the numbers from field `first` on; only of the lowest instance if `instance`
/// is given.
LogRows timed(const LogRows& rows, std::size_t second_time, std::size_t first, std::optional<std::size_t> instance) {
  double lowest = std::numeric_limits<double>::infinity();
  if (instance) {
    for (const auto& row : rows) lowest = std::fmin(lowest, row[*instance]);
  }
  LogRows result;
  for (const auto& row : rows) {
    if (instance && !std::isnan(row[*instance]) && row[*instance] != lowest) continue;
    std::vector<double> kept{first_known(row[0], row[second_time])};
    kept.insert(kept.end(), row.begin() + static_cast<std::ptrdiff_t>(first), row.end());
    result.push_back(std::move(kept));
  }
  return result;
}

/// Position data of the receiver or the estimator at one time; NaN for missing values.
struct Position {
  double time_s, instance, latitude_deg, longitude_deg, sea_level_m, utc_s;
  bool has_fix;
};

Position receiver_position(const std::vector<double>& row) {
  return {.time_s = first_known(row[0], first_known(row[1], row[10])),
          .instance = first_known(row[2], 0.0),
          .latitude_deg = row[4],
          .longitude_deg = row[5],
          .sea_level_m = row[6],
          .utc_s = utc_from_gps_s(first_known(row[7], row[8]), first_known(row[9], row[10])),
          .has_fix = !(row[3] < kThreeDimensionalFix)};
}

Position estimator_position(const std::vector<double>& row) {
  return {.time_s = row[0],
          .instance = 0.0,
          .latitude_deg = row[1],
          .longitude_deg = row[2],
          .sea_level_m = row[3],
          .utc_s = std::numeric_limits<double>::quiet_NaN(),
          .has_fix = true};
}

/// Rows of the newer filter's lowest core, else of the older filter: time, yaw, pitch, roll, north, east, down.
LogRows kalman_rows(const DataflashMessages& log) {
  const LogRows& newer = find_rows(log.rows, "XKF1");
  return timed(newer.empty() ? find_rows(log.rows, "NKF1") : newer, 1, 3, 2);
}

/// Positions of the filter, using its own conversion of degrees to metres (AP_Common's Location: a sphere of 6378100 m,
/// degrees of longitude scaled at the middle latitude). Empty if the log does not contain the origin.
std::vector<Position> kalman_positions(const DataflashMessages& log) {
  constexpr double kDegree_m = 111318.84502145034;
  constexpr double kOfTheFilter = 0.0;  // ORGN's Type; 1 is home
  const LogRows& origins = find_rows(log.rows, "ORGN");
  const auto origin = std::ranges::find_if(origins, [](const auto& row) {
    return first_known(row[1], kOfTheFilter) == kOfTheFilter && std::isfinite(row[2]) && std::isfinite(row[3]);
  });
  if (origin == origins.end()) return {};
  const double latitude_deg = (*origin)[2], longitude_deg = (*origin)[3], sea_level_m = (*origin)[4];
  std::vector<Position> positions;
  for (const auto& row : kalman_rows(log)) {
    const double north_deg = row[4] / kDegree_m;
    const double shrunk = std::cos((latitude_deg + 0.5 * north_deg) * std::numbers::pi / 180.0);
    positions.push_back({.time_s = row[0],
                         .instance = 0.0,
                         .latitude_deg = latitude_deg + north_deg,
                         .longitude_deg = longitude_deg + row[5] / (kDegree_m * shrunk),
                         .sea_level_m = sea_level_m - row[6],
                         .utc_s = std::numeric_limits<double>::quiet_NaN(),
                         .has_fix = true});
  }
  return positions;
}

bool is_usable(const Position& p) {
  return p.has_fix && std::isfinite(p.time_s) && std::isfinite(p.latitude_deg) && std::isfinite(p.longitude_deg);
}

/// The receiver's positions if it ever has a fix; else the estimator's; else the receiver's without fixes.
std::vector<Position> dataflash_positions(const DataflashMessages& log) {
  std::vector<Position> receiver, estimator;
  std::ranges::transform(find_rows(log.rows, "GPS"), std::back_inserter(receiver), receiver_position);
  std::ranges::transform(find_rows(log.rows, "POS"), std::back_inserter(estimator), estimator_position);
  double instance = std::numeric_limits<double>::infinity();
  for (const Position& p : receiver) {
    if (is_usable(p)) instance = std::min(instance, p.instance);
  }
  if (std::isinf(instance)) {
    if (estimator.empty()) estimator = kalman_positions(log);
    return estimator.empty() ? receiver : estimator;
  }
  std::erase_if(receiver, [&](const Position& p) { return p.instance != instance; });
  return receiver;
}

/// Rows of time and metres above the ellipsoid, of the receiver that the positions come from.
LogRows ellipsoidal_heights(const DataflashMessages& log, const std::vector<Position>& positions) {
  LogRows rows;
  for (const auto& row : find_rows(log.rows, "GPA")) {
    if (first_known(row[1], 0.0) == positions.front().instance && row[2] > kMinHeight_m)
      rows.push_back({row[0], row[2]});
  }
  return sort_by_time(std::move(rows));
}

LogRows heights_above_takeoff(const DataflashMessages& log) {
  LogRows rows;
  for (const auto& row : find_rows(log.rows, "POS")) {
    if (std::isfinite(row[4])) rows.push_back({row[0], row[4]});
  }
  if (rows.empty()) rows = timed(find_rows(log.rows, "BARO"), 1, 3, 2);
  return sort_by_time(std::move(rows));
}

LogRows attitudes_of(const DataflashMessages& log) {
  LogRows rows = timed(find_rows(log.rows, "ATT"), 1, 2, std::nullopt);
  if (rows.empty()) rows = kalman_rows(log);  // these rows hold more than the attitude
  if (rows.empty()) rows = timed(find_rows(log.rows, "AHR2"), 1, 2, std::nullopt);
  return sort_by_time(std::move(rows));
}

std::optional<double> finite(double value) { return std::isfinite(value) ? std::optional(value) : std::nullopt; }

/// Auxiliary data of a position at its time.
struct AuxiliaryData {
  LogRows ellipsoidal_m, above_takeoff_m, attitudes_deg;
  bool by_ellipsoid = false;
};

AuxiliaryData read_auxiliary(const DataflashMessages& log, const std::vector<Position>& positions) {
  AuxiliaryData found;
  if (positions.empty()) return found;
  found.ellipsoidal_m = ellipsoidal_heights(log, positions);
  found.above_takeoff_m = heights_above_takeoff(log);
  found.attitudes_deg = attitudes_of(log);
  found.by_ellipsoid = std::ranges::all_of(positions, [&](const Position& p) {
    return !is_usable(p) || nearest_in_time(found.ellipsoidal_m, p.time_s, kFarthest_s) != nullptr;
  });
  return found;
}

TelemetryFix dataflash_fix(const Position& position, const AuxiliaryData& beside) {
  TelemetryFix fix;
  fix.time_s = position.time_s;
  fix.latitude_deg = position.latitude_deg;
  fix.longitude_deg = position.longitude_deg;
  fix.absolute_height_m = beside.by_ellipsoid
                              ? (*nearest_in_time(beside.ellipsoidal_m, position.time_s, kFarthest_s))[1]
                              : finite(position.sea_level_m);
  if (const auto* row = nearest_in_time(beside.above_takeoff_m, position.time_s, kFarthest_s)) {
    fix.height_above_takeoff_m = finite((*row)[1]);
  }
  if (const auto* row = nearest_in_time(beside.attitudes_deg, position.time_s, kFarthest_s)) {
    fix.body_yaw_deg = finite((*row)[1]);
    fix.body_pitch_deg = finite((*row)[2]);
    fix.body_roll_deg = finite((*row)[3]);
  }
  return fix;
}

/// Rows of time and metres of the lowest downward-looking instance that has a valid reading.
LogRows ranges_of(const DataflashMessages& log) {
  constexpr double kDown = 25.0, kGood = 4.0;  // Rotation's ROTATION_PITCH_270, RangeFinder's Status::Good
  LogRows good;
  for (const auto& row : find_rows(log.rows, "RFND")) {
    const bool looks_down = first_known(row[4], kDown) == kDown, is_good = first_known(row[3], kGood) == kGood;
    if (looks_down && is_good && row[5] > 0.0)
      good.push_back({row[0], kNone, first_known(row[1], first_known(row[2], 0.0)), row[5]});
  }
  return sort_by_time(timed(good, 1, 3, 2));
}

/// UTC of the log's time 0, from the first position that has it.
std::optional<double> zero_utc_s(const std::vector<Position>& positions) {
  const auto known = std::ranges::find_if(
      positions, [](const Position& p) { return is_usable(p) && std::isfinite(p.utc_s) && is_unix_time(p.utc_s); });
  return known == positions.end() ? std::nullopt : std::optional(known->utc_s - known->time_s);
}

DataflashMessages messages_of(const std::filesystem::path& file) {
  return read_dataflash_messages(base::read_bytes(file, base::kMaxLogBytes), requested_messages(), file.string());
}

/// Data for both public readers, on one clock.
struct Flight {
  Telemetry telemetry;
  std::vector<RangeReading> ranges;
};

Flight flight_of(const std::filesystem::path& file) {
  const DataflashMessages log = messages_of(file);
  const std::vector<Position> positions = dataflash_positions(log);
  const AuxiliaryData known = read_auxiliary(log, positions);
  FixFilter filter;
  for (const Position& position : positions) {
    if (is_usable(position)) {
      filter.add(dataflash_fix(position, known));
    } else {
      filter.drop_without_fix();
    }
  }
  Flight flight{std::move(filter).finish(file.string(), "position messages", log.warnings), {}};
  Telemetry& telemetry = flight.telemetry;
  telemetry.warnings.insert(telemetry.warnings.end(), log.warnings.begin(), log.warnings.end());
  telemetry.body_rates = to_body_rates(timed(find_rows(log.rows, "IMU"), 1, 3, 2), 1.0);
  const double first_s = telemetry.fixes.front().time_s;
  telemetry.zero_utc_s = zero_utc_s(positions);
  if (telemetry.zero_utc_s) *telemetry.zero_utc_s += first_s;
  rebase_to_first_fix(telemetry);
  for (const auto& row : ranges_of(log)) flight.ranges.push_back({row[0] - first_s, row[1]});
  drop_fixes_without_height(telemetry);
  telemetry.height_datum = known.by_ellipsoid ? HeightDatum::kEllipsoid : HeightDatum::kMeanSeaLevel;
  return flight;
}

}  // namespace

Telemetry read_dataflash(const std::filesystem::path& file) { return flight_of(file).telemetry; }

std::vector<RangeReading> read_dataflash_ranges(const std::filesystem::path& file) { return flight_of(file).ranges; }

}  // namespace tileflight::flight_logs
