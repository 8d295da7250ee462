#pragma once

#include <filesystem>

#include "tileflight/flight/telemetry.h"

namespace tileflight::flight {

/// The points of all `gx:Track` elements of a KML file (OGC KML 2.3 `Track`, Google's extension before it), in the
/// file's order; seconds from the first. Altitudes are above sea level where `altitudeMode` is "absolute"; any other
/// mode, which is above the ground, gives no heights and a warning. A file that ends or breaks early is read up to the
/// last whole track, with a warning. Throws InputError (file, cause) when it is not KML, declares a document type, or
/// holds no such point.
Telemetry read_kml(const std::filesystem::path& file);

}  // namespace tileflight::flight
