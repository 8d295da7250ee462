#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "tileflight/core/geometry/geodesy.h"
#include "tileflight/core/geometry/imu_sample.h"
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
  /// Standard deviations that the log states: of each horizontal axis, and of the absolute height.
  std::optional<double> horizontal_sigma_m, vertical_sigma_m;
};

/// A gyroscope sample, on the clock of the fixes.
struct BodyRate {
  double time_s = 0.0;
  geometry::Vec3 rate_rad_s = geometry::Vec3::Zero();  ///< about the vehicle's axes: forward, right, down
};

/// The focal length and digital zoom that a camera states for one moment.
struct ZoomReading {
  double time_s = 0.0;                      ///< on the clock of the fixes
  std::string where;                        ///< for messages: the moment, or the photo's name
  std::optional<double> focal_length;       ///< in the unit of the log, which differs: only ratios count
  std::optional<double> focal_length_35mm;  ///< that of a 35 mm film with the same field of view, whole millimetres
  std::optional<double> digital_zoom;       ///< 1: none
};

/// The exposure of one frame of a video.
struct ExposureReading {
  double time_s = 0.0;  ///< of the frame, on the clock of the fixes
  double exposure_s = 0.0;
  std::optional<double> gain;  ///< of the sensor, in the unit of the log, which differs: only ratios count
};

/// Describes what the readings say against the use of one calibration: a focal length or digital zoom that changes
/// between them, with where and by how much, and a digital zoom other than 1 that does not change. Empty: nothing.
/// `source`: what the readings come from ("the subtitles").
std::vector<std::string> find_zoom_warnings(const std::vector<ZoomReading>& readings, const std::string& source);

/// Reference of a log's absolute heights.
enum class HeightDatum { kUnknown, kEllipsoid, kMeanSeaLevel };

/// The positions, attitudes and angular rates of a flight log.
struct Telemetry {
  std::vector<TelemetryFix> fixes;  ///< strictly increasing time; repeated positions (held between fixes) are kept
  HeightDatum height_datum = HeightDatum::kUnknown;
  std::string height_datum_note;     ///< what `height_datum` is concluded from, if the log does not state it; a line
  std::vector<BodyRate> body_rates;  ///< strictly increasing time; empty if the log has no gyroscope data
  std::vector<ZoomReading> zooms;    ///< of all entries that have any, in their order
  /// Readings of an inertial unit in the camera, strictly increasing time; its axes are the camera's (x right, y down,
  /// z forward) as frames are shown.
  std::vector<geometry::ImuSample> inertial;
  std::vector<ExposureReading> exposures;  ///< strictly increasing time
  std::string device;                      ///< name of the camera or vehicle, if the log states it
  std::optional<double> zero_utc_s;        ///< Unix time (UTC) of time 0, if the log states it
  std::vector<std::string> warnings;       ///< e.g. entries dropped, one line each
};

/// Converts GPS time (whole weeks since 6 January 1980 and seconds of the week) to UTC as Unix time, seconds since 1970
/// without leap seconds. IS-GPS-200, 3.3.4; leap seconds up to the one at the end of 2016 (IERS Bulletin C: none has
/// been announced since).
double utc_from_gps_s(double week, double seconds_of_week);

/// A measurement of a downward-looking range finder.
struct RangeReading {
  double time_s = 0.0;  ///< on the clock of read_dataflash's positions
  double range_m = 0.0;
};

/// Reads a flight log of any format in docs/formats.md (Telemetry), or a folder of geotagged photos. The format is
/// detected from the content; the file name only decides for subtitles that start with other text. Throws InputError
/// (file, cause) as the reader of the format does.
Telemetry read_telemetry(const std::filesystem::path& file);

/// Readings of a downward-looking range finder, on the same clock; empty for formats without range support (only
/// ArduPilot's has it). Throws InputError as the reader of the format does.
std::vector<RangeReading> read_ranges(const std::filesystem::path& file);

/// Reads DJI's subtitle telemetry (.srt). Times are the subtitles' time stamps, so 0 is the first frame of the
/// accompanying video; the one dialect without stamps (Mavic 2, 2017) gives seconds from its first entry. Entries
/// without a position fix ("N/A" or 0, 0), off the earth, or out of order are dropped and counted in `warnings`.
/// docs/formats.md lists the dialects; dji_srt.cpp describes how each is read. Throws InputError (file, entry, cause)
/// if no entry is usable.
Telemetry read_dji_srt(const std::filesystem::path& file);
/// Reads the text of such subtitles, as a video's own track holds them. `where`: the file, for messages.
Telemetry parse_dji_srt(std::string_view text, const std::string& where);

/// Returns whether text has a sentence of NMEA 0183 in its first lines.
bool is_nmea(std::string_view head);

/// Reads a receiver's log of NMEA 0183: positions of the GGA sentences (else RMC, without heights), the date of RMC.
/// Times are seconds from the first position; heights are above the ellipsoid if every sentence states the geoid's,
/// else above sea level. Sentences with a wrong checksum are dropped, with a warning. Throws InputError (file, cause)
/// if there is no position.
Telemetry read_nmea(const std::filesystem::path& file);

/// Returns whether bytes begin as the log of a ground station does: a time, then a MAVLink frame.
bool is_mavlink_log(std::string_view head);

/// Reads the log of a ground station (.tlog, MAVLink 1 and 2): GLOBAL_POSITION_INT and ATTITUDE of the first vehicle
/// that sends a position, on its own clock, which the ground station's continues after a restart. Heights are above sea
/// level and above take-off, without those from before a home is set. Damaged messages are skipped, with a warning.
/// Throws InputError (file, cause) if there is no position.
Telemetry read_mavlink_log(const std::filesystem::path& file);

/// Reads a table with a header row: cells separated by comma, semicolon or tab, any line end, quotes, an optional byte
/// order mark. Columns are identified by their names and units (docs/formats.md, Telemetry: CSV); time, latitude and
/// longitude are required. Times keep the log's clock; dates are converted to seconds from the first fix. Throws
/// InputError (file, cause) if a column is missing (listing those found), a unit is unknown, or no row holds a time and
/// a position.
Telemetry read_csv_log(const std::filesystem::path& file);

/// Reads the points of all `gx:Track` elements of a KML file (OGC KML 2.3 `Track`, formerly Google's extension) and the
/// placemarks that have a TimeStamp and a Point, in file order; times are seconds from the first point. Altitudes are
/// above sea level if `altitudeMode` is "absolute"; other modes are relative to the ground and give no heights and a
/// warning. A truncated or malformed file is read up to the last complete track, with a warning. Throws InputError
/// (file, cause) if the file is not KML, declares a document type, or holds no such point; a LineString, which has no
/// times, is named with the way to convert it.
Telemetry read_kml(const std::filesystem::path& file);

/// Reads the track points of a GPX 1.0 or 1.1 file (topografix.com/GPX/1/1), of all tracks and segments in file order;
/// times are seconds from the first point. Elevations are above mean sea level. Routes and waypoints are ignored. A
/// truncated or malformed file is read up to the fault, with a warning. Throws InputError (file, cause) if the file is
/// not GPX, declares a document type, or holds no track point with a time.
Telemetry read_gpx(const std::filesystem::path& file);

/// Reads PX4's log (.ulg). Positions are those of the first receiver (`vehicle_gps_position`, else `sensor_gps`; 3D
/// fixes only), or if there are none those of the estimator (`vehicle_global_position`); times are seconds from the
/// first. Heights are the receiver's above the ellipsoid if present, else above sea level. The attitude is the nearest
/// `vehicle_attitude` in time, at most 0.2 s away; angular rates are those of `vehicle_angular_velocity`, else
/// `sensor_combined`. Throws InputError (file, cause) if the file is not a ULog file or holds no position.
Telemetry read_ulog(const std::filesystem::path& file);

/// Valid readings of the downward-looking range finder (RFND) with the lowest instance number. Empty if the log has
/// none. Throws InputError as read_dataflash does.
std::vector<RangeReading> read_dataflash_ranges(const std::filesystem::path& file);

/// Reads ArduPilot's log (.bin). Positions are those of one receiver (GPS: the lowest instance with a 3D fix), or if
/// there are none those of the estimator (POS, else XKF1 or NKF1 of the lowest core, relative to ORGN); times are
/// seconds from the first. Heights are the receiver's above the ellipsoid if every fix has one (GPA's AEl), else above
/// sea level; heights above take-off are POS's above home, else the barometer's. The attitude is the nearest in time of
/// ATT (else XKF1, NKF1, AHR2), at most 0.2 s away; angular rates are those of IMU, lowest instance. UTC comes from the
/// receiver's GPS week. Throws InputError (file, cause) if the file is not such a log or holds no position.
Telemetry read_dataflash(const std::filesystem::path& file);

/// Removes repeated positions. Logs repeat a position until the receiver has the next one (10 Hz positions in 30 Hz
/// subtitles). Keeps the first entry of each run of equal latitude, longitude and heights: the position belongs to its
/// time.
std::vector<TelemetryFix> distinct_fixes(const Telemetry& telemetry);

}  // namespace tileflight::flight_logs
