#pragma once

#include <cstddef>
#include <filesystem>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "tileflight/data/flight_logs/telemetry.h"

namespace tileflight::flight_logs {

/// Metadata of a photo: EXIF 2.32 (CIPA DC-008) and the XMP fields of DJI's cameras (drone-dji:).
struct PhotoTags {
  std::optional<double> taken_at_s;  ///< since 1970, by the camera's clock; UTC if its offset is stated
  std::optional<double> exposure_s;
  int orientation = 1;  ///< EXIF orientation, 1 (upright) to 8
  std::optional<double> latitude_deg, longitude_deg;
  std::optional<double> absolute_height_m;
  bool height_is_ellipsoidal = false;  ///< else above sea level, as EXIF defines it
  std::optional<double> height_above_takeoff_m;
  std::optional<double> gimbal_yaw_deg, gimbal_pitch_deg, gimbal_roll_deg;
  std::optional<double> body_yaw_deg, body_pitch_deg, body_roll_deg;
  std::optional<double> focal_length_mm, focal_length_35mm, digital_zoom;
};

/// Reads the tags of a JPEG; the bytes before the image data suffice. Missing or invalid values are left empty; a file
/// without tags (not a JPEG, damaged) yields none. Never throws because of the content.
PhotoTags read_photo_tags(std::span<const std::byte> jpeg);

/// Time at which a photo was taken.
struct PhotoTime {
  double time_s = 0.0;       ///< from the folder's first photo
  double exposure_ms = 0.0;  ///< 0: unknown
};

/// Times and positions read from the tags of a flight's photos (photo_log.h).
struct PhotoLog {
  double start_utc_s = 0.0;                ///< of the first photo with a time, since 1970, by the camera's clock
  std::map<std::string, PhotoTime> times;  ///< by file name; all photos with a capture time
  std::vector<ZoomReading> zooms;          ///< of all photos that state any, in order of their names
  Telemetry telemetry;                     ///< photos that also have a position; may have no fixes
  std::size_t photos = 0;                  ///< JPEG files in the folder
  std::vector<std::string> warnings;       ///< about `times`, one line each
};

/// Reads all JPEG files of a folder. Cameras that record whole seconds give several photos the same time; these are
/// spread evenly over the second, in order of their names. Heights are above sea level, or above the ellipsoid if all
/// photos say so. Throws InputError: no such folder, a file that cannot be read.
PhotoLog read_photo_log(const std::filesystem::path& folder);

}  // namespace tileflight::flight_logs
