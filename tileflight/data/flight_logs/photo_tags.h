#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <string>

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
};

/// Reads the tags of a JPEG; the bytes before the image data suffice. Missing or invalid values are left empty; a file
/// without tags (not a JPEG, damaged) yields none. Never throws because of the content.
PhotoTags read_photo_tags(std::span<const std::byte> jpeg);

}  // namespace tileflight::flight_logs
