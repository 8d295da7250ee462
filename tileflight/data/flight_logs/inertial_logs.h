#pragma once

#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "tileflight/core/geometry/imu_sample.h"

namespace tileflight::flight_logs {

/// Readings of an inertial unit as a logger wrote them.
struct InertialLog {
  std::vector<geometry::ImuSample> readings;  ///< strictly increasing times
  std::vector<std::string> notes;             ///< axes, assumptions and what was dropped; a sentence each
};

/// Splits a line of a table at its commas. An empty field stays one; quotes around a field are removed, and a comma
/// within them separates all the same.
std::vector<std::string_view> split_at_commas(std::string_view line);

/// Returns whether a file's first bytes are those of a log that read_inertial_log() reads.
bool is_inertial_log(std::string_view head);

/// Reads Gyroflow's .gcsv, Betaflight's blackbox (.bbl, .bfl) or the CSV of its decoders. Throws InputError (file,
/// cause) as the reader of the format does.
InertialLog read_inertial_log(const std::filesystem::path& file);

/// Reads Gyroflow's .gcsv (docs.gyroflow.xyz, "GCSV format"). Times are those of the video that it accompanies. With
/// the key `orientation` the readings are in the camera's axes: x right, y down, z forward. Throws InputError (where,
/// cause): no scales, no accelerometer, an orientation that is none or mirrors, numbers that are none.
InertialLog parse_gcsv(std::string_view text, const std::string& where);

/// Reads the CSV of blackbox_decode or of the Blackbox Explorer: gyroADC and accSmooth. Times are seconds from the
/// first row; axes are the vehicle's: x forward, y left, z up. Throws InputError (where, cause): columns that are
/// missing, a scale of the accelerometer that cannot be told.
InertialLog parse_blackbox_csv(std::string_view text, const std::string& where);

/// Decodes the longest recording of a blackbox log, data version 2 (Betaflight's "Blackbox Internals"): its main
/// frames. Times and axes are as those of parse_blackbox_csv(). Damaged frames are left out and counted. Throws
/// InputError (where, cause): no gyroscope or accelerometer, another version, more damage than data.
InertialLog parse_blackbox(std::string_view bytes, const std::string& where);

}  // namespace tileflight::flight_logs
