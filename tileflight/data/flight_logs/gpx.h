#pragma once

#include <filesystem>

#include "tileflight/data/flight_logs/telemetry.h"

namespace tileflight::flight_logs {

/// Reads the track points of a GPX 1.0 or 1.1 file (topografix.com/GPX/1/1), of all tracks and segments in file order;
/// times are seconds from the first point. Elevations are above mean sea level. Routes and waypoints are ignored. A
/// truncated or malformed file is read up to the fault, with a warning. Throws InputError (file, cause) if the file is
/// not GPX, declares a document type, or holds no track point with a time.
Telemetry read_gpx(const std::filesystem::path& file);

}  // namespace tileflight::flight_logs
