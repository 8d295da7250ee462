#pragma once

#include <filesystem>

#include "tileflight/flight/telemetry.h"

namespace tileflight::flight {

/// The track points of a GPX 1.0 or 1.1 file (topografix.com/GPX/1/1), of all its tracks and segments in the file's
/// order; seconds from the first of them. Elevations are above mean sea level. Routes and waypoints are not read. A
/// file that ends or breaks early is read up to there, with a warning. Throws InputError (file, cause) when it is not
/// GPX, declares a document type, or holds no track point with a time.
Telemetry read_gpx(const std::filesystem::path& file);

}  // namespace tileflight::flight
