#pragma once

#include <optional>
#include <string>
#include <vector>

#include "tileflight/data/flight_logs/telemetry.h"

namespace tileflight::flight_logs {

/// Describes what the readings say against the use of one calibration: a focal length or digital zoom that changes
/// between them, with where and by how much, and a digital zoom other than 1 that does not change. Empty: nothing.
/// `source`: what the readings come from ("the subtitles").
std::vector<std::string> find_zoom_warnings(const std::vector<ZoomReading>& readings, const std::string& source);

}  // namespace tileflight::flight_logs
