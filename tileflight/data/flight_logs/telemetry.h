#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "tileflight/core/geometry/geodesy.h"
#include "tileflight/core/geometry/transform.h"

namespace tileflight::flight_logs {

/// One position of a flight log, on the log's own clock (seconds from its first entry unless the reader states
/// otherwise).
struct TelemetryFix {
  double time_s = 0.0;
  double latitude_deg = 0.0;
  double longitude_deg = 0.0;
  std::optional<double> absolute_height_m;  ///< as stored in the log; its datum is Telemetry::height_datum
  std::optional<double> height_above_takeoff_m;
  std::optional<double> gimbal_yaw_deg, gimbal_pitch_deg, gimbal_roll_deg;
  /// The vehicle's own attitude: yaw clockwise from north, then pitch (nose up), then roll (right side down).
  std::optional<double> body_yaw_deg, body_pitch_deg, body_roll_deg;
};

/// A gyroscope sample, on the clock of the fixes.
struct BodyRate {
  double time_s = 0.0;
  geometry::Vec3 rate_rad_s = geometry::Vec3::Zero();  ///< about the vehicle's axes: forward, right, down
};

/// Reference of a log's absolute heights.
enum class HeightDatum { kUnknown, kEllipsoid, kMeanSeaLevel };

/// The positions, attitudes and angular rates of a flight log.
struct Telemetry {
  std::vector<TelemetryFix> fixes;  ///< strictly increasing time; repeated positions (held between fixes) are kept
  HeightDatum height_datum = HeightDatum::kUnknown;
  std::vector<BodyRate> body_rates;   ///< strictly increasing time; empty if the log has no gyroscope data
  std::optional<double> zero_utc_s;   ///< Unix time (UTC) of time 0, if the log states it
  std::vector<std::string> warnings;  ///< e.g. entries dropped, one line each
};

/// Reads DJI's subtitle telemetry (.srt). Times are the subtitles' time stamps, so 0 is the first frame of the
/// accompanying video; the one dialect without stamps (Mavic 2, 2017) gives seconds from its first entry. Entries
/// without a position fix ("N/A" or 0, 0), off the earth, or out of order are dropped and counted in `warnings`.
/// docs/formats.md lists the dialects; telemetry.cpp describes how each is read. Throws InputError (file, entry, cause)
/// if no entry is usable.
Telemetry read_dji_srt(const std::filesystem::path& file);

/// Removes repeated positions. Logs repeat a position until the receiver has the next one (10 Hz positions in 30 Hz
/// subtitles). Keeps the first entry of each run of equal latitude, longitude and heights: the position belongs to its
/// time.
std::vector<TelemetryFix> distinct_fixes(const Telemetry& telemetry);

}  // namespace tileflight::flight_logs
