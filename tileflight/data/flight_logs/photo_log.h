#pragma once

#include <cstddef>
#include <filesystem>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "tileflight/data/flight_logs/telemetry.h"

namespace tileflight::flight_logs {

/// Holds what a photo's tags say of its lens. The numbers are as the tags hold them; none is checked.
struct PhotoLensTags {
  std::string make, model;                ///< of the camera, EXIF Make and Model
  int width = 0, height = 0;              ///< pixels, of the JPEG as it is stored; 0: unknown
  int taken_width = 0, taken_height = 0;  ///< as it was taken, EXIF PixelXDimension and PixelYDimension; 0: not stated
  std::optional<double> focal_length_35mm;  ///< of a 35 mm film with the same field of view
  /// Focal length in pixels of the size at which the photo was taken, by EXIF's FocalLength and FocalPlaneXResolution.
  std::optional<double> focal_plane_px;
  /// DJI's CalibratedFocalLength and CalibratedOpticalCenterX, Y: the lens as it was designed, in pixels.
  std::optional<double> design_focal_px, design_centre_x_px, design_centre_y_px;
  /// DJI's DewarpData, fx fy cx cy k1 k2 p1 p2 k3, or DewarpDataK6, which adds k4 k5 k6; empty: neither. fx to cy are
  /// in pixels, cx and cy from the image's centre; the others are OpenCV's.
  std::vector<double> dewarp;
  std::string dewarp_date;   ///< of the calibration, "2022-03-02"; empty: not stated
  bool is_dewarped = false;  ///< DJI's DewarpFlag: the camera has removed the distortion from the image
};

/// States how well a receiver knew its position at a photo: DJI's RtkFlag. DJI's manuals (Zenmuse P1, Mavic 3M, Matrice
/// 4) define 0, 16, 32 to 49, and 50; between them it counts as NovAtel's types of positions, which it has its values
/// from.
enum class RtkSolution { kNone, kSingle, kFloat, kFixed };

/// Metadata of a photo: EXIF 2.32 (CIPA DC-008), the XMP fields of DJI's cameras (drone-dji:) and senseFly's heights.
struct PhotoTags {
  std::optional<double> taken_at_s;  ///< since 1970, by the camera's clock; UTC if its offset is stated
  std::optional<double> exposure_s;
  int orientation = 1;  ///< EXIF orientation, 1 (upright) to 8
  std::optional<double> latitude_deg, longitude_deg;
  std::optional<double> absolute_height_m;
  HeightDatum height_datum = HeightDatum::kUnknown;  ///< of absolute_height_m, by the rules of docs/formats.md (Photos)
  bool states_height_datum = true;                   ///< whether a tag says so; else it is concluded from RtkFlag
  std::optional<RtkSolution> rtk_solution;
  /// DJI's RtkStdLat, RtkStdLon and RtkStdHgt, if they are above 0 and there is a solution.
  std::optional<double> latitude_sigma_m, longitude_sigma_m, height_sigma_m;
  std::optional<double> height_above_takeoff_m;
  std::optional<double> gimbal_yaw_deg, gimbal_pitch_deg, gimbal_roll_deg;
  std::optional<double> body_yaw_deg, body_pitch_deg, body_roll_deg;
  std::optional<double> focal_length_mm, digital_zoom;
  PhotoLensTags lens;
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
  std::vector<std::pair<std::string, PhotoLensTags>> lenses;  ///< by file name, of all photos, in order of the names
  Telemetry telemetry;                                        ///< photos that also have a position; may have no fixes
  std::size_t photos = 0;                                     ///< JPEG files in the folder
  std::vector<std::string> warnings;                          ///< about `times`, one line each
};

/// Reads all JPEG files of a folder. Cameras that record whole seconds give several photos the same time; these are
/// spread evenly over the second, in order of their names. Heights are above the ellipsoid if any photo's are; then
/// those of the other photos are left out, with a warning. Else they count as above sea level;
/// Telemetry::height_datum_note says so if the photos do not. Throws InputError: no such folder, a file that cannot be
/// read.
PhotoLog read_photo_log(const std::filesystem::path& folder);

}  // namespace tileflight::flight_logs
