#pragma once

#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "tileflight/data/flight_logs/telemetry.h"

namespace tileflight::flight_logs {

/// When a photo was taken.
struct PhotoTime {
  double time_s = 0.0;       ///< from the folder's first photo
  double exposure_ms = 0.0;  ///< 0: unknown
};

/// Times and positions read from the tags of a flight's photos (photo_tags.h).
struct PhotoLog {
  double start_utc_s = 0.0;                ///< of the first photo with a time, since 1970, by the camera's clock
  std::map<std::string, PhotoTime> times;  ///< by file name; all photos with a capture time
  Telemetry telemetry;                     ///< photos that also have a position; may have no fixes
  std::size_t photos = 0;                  ///< JPEG files in the folder
  std::vector<std::string> warnings;       ///< about `times`, one line each
};

/// Reads all JPEG files of a folder. Cameras that record whole seconds give several photos the same time; these are
/// spread evenly over the second, in order of their names. Heights are above sea level, or above the ellipsoid if all
/// photos say so. Throws InputError: no such folder, a file that cannot be read.
PhotoLog read_photo_log(const std::filesystem::path& folder);

}  // namespace tileflight::flight_logs
