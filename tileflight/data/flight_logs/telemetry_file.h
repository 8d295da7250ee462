#pragma once

#include <filesystem>
#include <vector>

#include "tileflight/data/flight_logs/dataflash_log.h"
#include "tileflight/data/flight_logs/telemetry.h"

namespace tileflight::flight_logs {

/// Reads a flight log of any format in docs/formats.md (Telemetry), or a folder of geotagged photos. The format is
/// detected from the content; the file name only decides for subtitles that start with other text. Throws InputError
/// (file, cause) as the reader of the format does.
Telemetry read_telemetry(const std::filesystem::path& file);

/// Readings of a downward-looking range finder, on the same clock; empty for formats without range support (only
/// ArduPilot's has it). Throws InputError as the reader of the format does.
std::vector<RangeReading> read_ranges(const std::filesystem::path& file);

}  // namespace tileflight::flight_logs
