#include "tileflight/data/flight_logs/ulog.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "tileflight/core/base/files.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/text_parsing.h"
#include "tileflight/data/flight_logs/fix_filter.h"
#include "tileflight/data/flight_logs/timed_rows.h"
#include "tileflight/data/flight_logs/ulog_topics.h"

namespace tileflight::flight_logs {
namespace {

constexpr double kDegrees = 180.0 / std::numbers::pi;
constexpr double kFarthestAttitude_s = 0.2;
constexpr double kULogThreeDimensionalFix = 3;

/// Receiver topics use degrees and metres since PX4 1.14; before, 1e-7 degrees and millimetres.
const UlogFields kReceiverFields = {
    "timestamp", "latitude_deg", "longitude_deg", "altitude_msl_m", "altitude_ellipsoid_m",
    "lat",       "lon",          "alt",           "alt_ellipsoid",  "fix_type"};
const UlogFields kEstimatorFields = {"timestamp", "lat", "lon", "alt", "alt_ellipsoid"};
const UlogFields kAttitudeFields = {"timestamp", "q[0]", "q[1]", "q[2]", "q[3]"};

/// One position; missing numbers are NaN.
struct ULogPosition {
  double time_s, latitude_deg, longitude_deg, sea_level_m, ellipsoid_m;
  bool has_fix;
};

ULogPosition ulog_receiver_position(const std::vector<double>& row) {
  const bool has_degrees = !std::isnan(row[1]);
  return {.time_s = 1e-6 * row[0],
          .latitude_deg = has_degrees ? row[1] : 1e-7 * row[5],
          .longitude_deg = has_degrees ? row[2] : 1e-7 * row[6],
          .sea_level_m = has_degrees ? row[3] : 1e-3 * row[7],
          .ellipsoid_m = has_degrees ? row[4] : 1e-3 * row[8],
          .has_fix = !(row[9] < kULogThreeDimensionalFix)};
}

ULogPosition ulog_estimator_position(const std::vector<double>& row) {
  return {.time_s = 1e-6 * row[0],
          .latitude_deg = row[1],
          .longitude_deg = row[2],
          .sea_level_m = row[3],
          .ellipsoid_m = row[4],
          .has_fix = true};
}

bool is_usable_ulog_position(const ULogPosition& p) {
  return p.has_fix && std::isfinite(p.time_s) && std::isfinite(p.latitude_deg) && std::isfinite(p.longitude_deg);
}

/// Positions of the first topic that holds a fix; else of the last one with data.
std::vector<ULogPosition> ulog_positions(const UlogTopics& topics) {
  std::vector<ULogPosition> positions;
  for (const char* name : {"vehicle_gps_position", "sensor_gps", "vehicle_global_position"}) {
    const auto found = topics.rows.find(name);
    if (found == topics.rows.end()) continue;
    const bool is_estimate = found->first == "vehicle_global_position";
    positions.clear();
    std::transform(found->second.begin(), found->second.end(), std::back_inserter(positions),
                   is_estimate ? ulog_estimator_position : ulog_receiver_position);
    if (std::any_of(positions.begin(), positions.end(), is_usable_ulog_position)) break;
  }
  return positions;
}

/// Drivers and simulators without a geoid leave the field at 0, or copy the other height into it.
bool has_ellipsoidal_heights(const std::vector<ULogPosition>& positions) {
  return std::any_of(positions.begin(), positions.end(), [](const ULogPosition& p) {
    return std::isfinite(p.ellipsoid_m) && p.ellipsoid_m != 0.0 && p.ellipsoid_m != p.sea_level_m;
  });
}

/// Yaw, pitch and roll of a body (axes forward, right, down) in north, east, down, from its unit quaternion w, x, y, z
/// (Diebel, "Representing Attitude", 2006, section 5.6, sequence 1, 2, 3).
void set_attitude(TelemetryFix& fix, const std::vector<double>& row) {
  const double norm = std::hypot(std::hypot(row[1], row[2]), std::hypot(row[3], row[4]));
  if (!(norm > 0.5) || !std::isfinite(norm)) return;
  const double w = row[1] / norm, x = row[2] / norm, y = row[3] / norm, z = row[4] / norm;
  fix.body_yaw_deg = kDegrees * std::atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z));
  fix.body_pitch_deg = kDegrees * std::asin(std::clamp(2 * (w * y - z * x), -1.0, 1.0));
  fix.body_roll_deg = kDegrees * std::atan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y));
}

/// Angular rates as filtered for the controller, else the sensor's.
std::vector<BodyRate> body_rates(const UlogTopics& topics) {
  const LogRows& filtered = find_rows(topics.rows, "vehicle_angular_velocity");
  return to_body_rates(filtered.empty() ? find_rows(topics.rows, "sensor_combined") : filtered, 1e-6);
}

FixFilter filtered(const std::vector<ULogPosition>& positions, bool ellipsoidal, const LogRows& attitudes) {
  FixFilter filter;
  for (const ULogPosition& position : positions) {
    if (!is_usable_ulog_position(position)) {
      filter.drop_without_fix();
      continue;
    }
    TelemetryFix fix;
    fix.time_s = position.time_s;
    fix.latitude_deg = position.latitude_deg;
    fix.longitude_deg = position.longitude_deg;
    const double height_m = ellipsoidal ? position.ellipsoid_m : position.sea_level_m;
    if (std::isfinite(height_m)) fix.absolute_height_m = height_m;
    if (const auto* row = nearest_in_time(attitudes, 1e6 * fix.time_s, 1e6 * kFarthestAttitude_s))
      set_attitude(fix, *row);
    filter.add(fix);
  }
  return filter;
}

}  // namespace

Telemetry read_ulog(const std::filesystem::path& file) {
  const std::map<std::string, UlogFields> requested = {
      {"vehicle_gps_position", kReceiverFields},
      {"sensor_gps", kReceiverFields},
      {"vehicle_global_position", kEstimatorFields},
      {"vehicle_attitude", kAttitudeFields},
      {"vehicle_angular_velocity", {"timestamp", "xyz[0]", "xyz[1]", "xyz[2]"}},
      {"sensor_combined", {"timestamp", "gyro_rad[0]", "gyro_rad[1]", "gyro_rad[2]"}}};
  const std::vector<std::byte> bytes = base::read_bytes(file, base::kMaxLogBytes);
  const UlogTopics topics = read_ulog_topics(bytes, requested, file.string());
  const std::vector<ULogPosition> positions = ulog_positions(topics);
  const bool ellipsoidal = has_ellipsoidal_heights(positions);
  Telemetry telemetry = filtered(positions, ellipsoidal, sort_by_time(find_rows(topics.rows, "vehicle_attitude")))
                            .finish(file.string(), "position messages");
  telemetry.warnings.insert(telemetry.warnings.end(), topics.warnings.begin(), topics.warnings.end());
  telemetry.body_rates = body_rates(topics);
  rebase_to_first_fix(telemetry);
  drop_fixes_without_height(telemetry);
  telemetry.height_datum = ellipsoidal ? HeightDatum::kEllipsoid : HeightDatum::kMeanSeaLevel;
  return telemetry;
}

}  // namespace tileflight::flight_logs
