#pragma once

#include <filesystem>

#include "tileflight/data/flight_logs/telemetry.h"

namespace tileflight::flight_logs {

/// Reads the points of all `gx:Track` elements of a KML file (OGC KML 2.3 `Track`, formerly Google's extension), in
/// file order; times are seconds from the first point. Altitudes are above sea level if `altitudeMode` is "absolute";
/// other modes are relative to the ground and give no heights and a warning. A truncated or malformed file is read up
/// to the last complete track, with a warning. Throws InputError (file, cause) if the file is not KML, declares a
/// document type, or holds no such point.
Telemetry read_kml(const std::filesystem::path& file);

/// Reads the track points of a GPX 1.0 or 1.1 file (topografix.com/GPX/1/1), of all tracks and segments in file order;
/// times are seconds from the first point. Elevations are above mean sea level. Routes and waypoints are ignored. A
/// truncated or malformed file is read up to the fault, with a warning. Throws InputError (file, cause) if the file is
/// not GPX, declares a document type, or holds no track point with a time.
Telemetry read_gpx(const std::filesystem::path& file);

}  // namespace tileflight::flight_logs
