#pragma once

#include <filesystem>
#include <vector>

#include "tileflight/flight/dataflash_log.h"
#include "tileflight/flight/telemetry.h"

namespace tileflight::flight {

/// A flight log of any format that docs/formats.md names (Telemetry), or a folder of photos that say where they were
/// taken. What it is is told from its content; its name decides only where subtitles begin with something else. Throws
/// InputError (file, cause) as its reader does.
Telemetry read_telemetry(const std::filesystem::path& file);

/// What a range finder that looks down said, on the same clock; empty for a log whose format is not read for it
/// (ArduPilot's is). Throws InputError as its reader does.
std::vector<RangeReading> read_ranges(const std::filesystem::path& file);

}  // namespace tileflight::flight
