#pragma once

#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "tileflight/flight/telemetry.h"

namespace tileflight::flight {

/// When a photo was taken.
struct PhotoTime {
  double time_s = 0.0;       ///< from the folder's first photo
  double exposure_ms = 0.0;  ///< 0: unknown
};

/// What the photos of a flight say of it (photo_tags.h).
struct PhotoLog {
  std::map<std::string, PhotoTime> times;  ///< by file name; all photos that say when they were taken
  Telemetry telemetry;                     ///< of those that say where, too; may have no fixes
  std::size_t photos = 0;                  ///< JPEG files in the folder
  std::vector<std::string> warnings;       ///< of `times`, one line each
};

/// Cameras that count whole seconds give photos of one second the same time: these are spread evenly over it, in the
/// order of their names. Heights are as the photos have them: above sea level, or above the ellipsoid where all of them
/// say so. Throws InputError: no such folder, a file that cannot be read.
PhotoLog read_photo_log(const std::filesystem::path& folder);

}  // namespace tileflight::flight
