#pragma once

#include <filesystem>

#include "tileflight/flight/telemetry.h"

namespace tileflight::flight {

/// A table with a header: comma, semicolon or tab between cells, either line end, quotes, byte order mark. Columns are
/// known by their names and units (docs/formats.md, Telemetry: CSV); time, latitude and longitude must be there. Times
/// stay on their own clock, dates count from the first fix. Throws InputError (file, cause) when a column is missing
/// (with those that were found), a unit is not known, or no row holds a time and a position.
Telemetry read_csv_log(const std::filesystem::path& file);

}  // namespace tileflight::flight
