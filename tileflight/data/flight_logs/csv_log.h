#pragma once

#include <filesystem>

#include "tileflight/data/flight_logs/telemetry.h"

namespace tileflight::flight_logs {

/// Reads a table with a header row: cells separated by comma, semicolon or tab, any line end, quotes, an optional byte
/// order mark. Columns are identified by their names and units (docs/formats.md, Telemetry: CSV); time, latitude and
/// longitude are required. Times keep the log's clock; dates are converted to seconds from the first fix. Throws
/// InputError (file, cause) if a column is missing (listing those found), a unit is unknown, or no row holds a time and
/// a position.
Telemetry read_csv_log(const std::filesystem::path& file);

}  // namespace tileflight::flight_logs
