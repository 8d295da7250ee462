#pragma once

#include <filesystem>

#include "tileflight/data/flight_logs/telemetry.h"
#include "tileflight/core/geometry/geodesy.h"

namespace tileflight::ingest {

/// Height of a log's take-off point, for logs whose heights are relative to it: the ground truth's surface at the
/// earliest position at which the vehicle is on the ground (at most 2 m above the log's zero). The median over a radius
/// of 2 m reduces the effect of receiver errors and foliage. `truth`: a folder written by extract(). Throws InputError:
/// truth without georeference or surface, a log that starts in the air or outside the region.
geometry::EllipsoidalHeight estimate_takeoff_height(const flight_logs::Telemetry& telemetry,
                                                    const std::filesystem::path& log,
                                                    const std::filesystem::path& truth);

}  // namespace tileflight::ingest
