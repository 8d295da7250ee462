#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <string>

namespace tileflight::flight {

/// What a photo says of itself: EXIF 2.32 (CIPA DC-008), and in XMP what DJI's cameras write (drone-dji:).
struct PhotoTags {
  std::optional<double> taken_at_s;  ///< since 1970, by the camera's clock; UTC where its offset is stated
  std::optional<double> exposure_s;
  int orientation = 1;  ///< how a viewer would turn the picture: 1 not at all, up to 8
  std::optional<double> latitude_deg, longitude_deg;
  std::optional<double> absolute_height_m;
  bool height_is_ellipsoidal = false;  ///< else above sea level, as EXIF has it
  std::optional<double> height_above_takeoff_m;
  std::optional<double> gimbal_yaw_deg, gimbal_pitch_deg, gimbal_roll_deg;
  std::optional<double> body_yaw_deg, body_pitch_deg, body_roll_deg;
};

/// Tags of a JPEG, of which the part before the picture is enough. What is missing or makes no sense is left empty; a
/// file without any (not a JPEG, damaged) has none. Never throws for what is in the file.
PhotoTags read_photo_tags(std::span<const std::byte> jpeg);

}  // namespace tileflight::flight
