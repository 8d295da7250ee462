#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "tileflight/geometry/geodesy.h"

namespace tileflight::flight {

/// One position of a flight log, on the log's own clock (seconds from its first entry unless it says more).
struct TelemetryFix {
  double time_s = 0.0;
  double latitude_deg = 0.0;
  double longitude_deg = 0.0;
  std::optional<double> absolute_height_m;   ///< as the log names it; its datum is Telemetry::height_datum
  std::optional<double> height_above_takeoff_m;
  std::optional<double> gimbal_yaw_deg, gimbal_pitch_deg, gimbal_roll_deg;
};

enum class HeightDatum { kUnknown, kEllipsoid, kMeanSeaLevel };

struct Telemetry {
  std::vector<TelemetryFix> fixes;  ///< strictly increasing time; repeated positions (held between fixes) are kept
  HeightDatum height_datum = HeightDatum::kUnknown;
  std::vector<std::string> warnings;  ///< e.g. entries dropped, one line each
};

/// DJI's subtitle telemetry (.srt), several dialects. Entries without a position fix (0, 0) are dropped and counted.
/// Throws InputError (file, entry, cause) when nothing usable is in it.
Telemetry read_dji_srt(const std::filesystem::path& file);

}  // namespace tileflight::flight
