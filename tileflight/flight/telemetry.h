#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "tileflight/geometry/geodesy.h"
#include "tileflight/geometry/transform.h"

namespace tileflight::flight {

/// One position of a flight log, on the log's own clock (seconds from its first entry unless it says more).
struct TelemetryFix {
  double time_s = 0.0;
  double latitude_deg = 0.0;
  double longitude_deg = 0.0;
  std::optional<double> absolute_height_m;  ///< as the log names it; its datum is Telemetry::height_datum
  std::optional<double> height_above_takeoff_m;
  std::optional<double> gimbal_yaw_deg, gimbal_pitch_deg, gimbal_roll_deg;
  /// The vehicle's own attitude: yaw clockwise from north, then pitch (nose up), then roll (right side down).
  std::optional<double> body_yaw_deg, body_pitch_deg, body_roll_deg;
};

/// What the vehicle's gyroscope said, on the clock of the fixes.
struct BodyRate {
  double time_s = 0.0;
  geometry::Vec3 rate_rad_s = geometry::Vec3::Zero();  ///< about the vehicle's axes: forward, right, down
};

enum class HeightDatum { kUnknown, kEllipsoid, kMeanSeaLevel };

struct Telemetry {
  std::vector<TelemetryFix> fixes;  ///< strictly increasing time; repeated positions (held between fixes) are kept
  HeightDatum height_datum = HeightDatum::kUnknown;
  std::vector<BodyRate> body_rates;   ///< strictly increasing time; empty where the log has no gyroscope's
  std::optional<double> zero_utc_s;   ///< time 0 as seconds since 1970 in UTC, where the log knows it
  std::vector<std::string> warnings;  ///< e.g. entries dropped, one line each
};

/// DJI's subtitle telemetry (.srt). Times are the subtitles' own stamps, so that 0 is the first picture of the video
/// beside it; the one dialect without stamps (Mavic 2, 2017) gives seconds from its first entry. Entries without a
/// position fix ("N/A" or 0, 0), off the earth, or out of order are dropped and counted in `warnings`. docs/formats.md
/// has the dialects; telemetry.cpp says how each is read. Throws InputError (file, entry, cause) when nothing usable is
/// in it.
Telemetry read_dji_srt(const std::filesystem::path& file);

/// Logs repeat a position until the receiver has the next one (10 Hz positions in 30 Hz subtitles): only the first
/// entry of each run of equal latitude, longitude and heights, which is the entry whose time belongs to the position.
std::vector<TelemetryFix> distinct_fixes(const Telemetry& telemetry);

}  // namespace tileflight::flight
