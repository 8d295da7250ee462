#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "tileflight/data/flight_logs/telemetry.h"

namespace tileflight::ingest {

/// Telemetry that a recording holds itself, on the clock of its first frame.
struct EmbeddedTelemetry {
  std::string kind;  ///< "GoPro's metadata (GPMF)", "DJI's metadata (djmd)" or "subtitles"
  flight_logs::Telemetry telemetry;
};

/// Tells a video, by its content, from a flight log or a folder of photos.
bool is_video(const std::filesystem::path& file);

/// Reads what a recording of one camera holds of its flight: a track of GoPro's or DJI's metadata, else subtitles.
/// `parts`: the files into which the camera cut it, in order; the times of each are later by the lengths of those
/// before (dataset::part_starts_s). nullopt if the first part is no video or holds neither. Throws InputError (file,
/// cause) for telemetry that cannot be read.
std::optional<EmbeddedTelemetry> read_embedded_telemetry(const std::vector<std::filesystem::path>& parts);

/// Checks the names that GoPro gives the parts of a recording (GH010123.MP4, GH020123.MP4; GOPR0123.MP4, GP010123.MP4),
/// in order. Throws InputError (file, cause) if they are of different recordings or a part between two is missing;
/// other names are not checked.
void check_chapters(const std::vector<std::filesystem::path>& parts);

/// Describes telemetry in one line: "GoPro's metadata (GPMF) in a.mp4: HERO11 Black, 47 positions, …".
std::string describe(const EmbeddedTelemetry& found, const std::filesystem::path& video);

}  // namespace tileflight::ingest
