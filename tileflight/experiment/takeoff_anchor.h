#pragma once

#include <filesystem>

#include "tileflight/flight/telemetry.h"
#include "tileflight/geometry/geodesy.h"

namespace tileflight::experiment {

/// Height of the place from which a log's flight took off, for logs that know heights above it only: that of the ground
/// truth's surface where the log has the vehicle on the ground (at most 2 m above its zero; the earliest such
/// position). What a receiver and a canopy of leaves may do to one vertical is met by the median over 2 m around.
/// `truth`: a folder that extract() wrote. Throws InputError: truth without georeference or surface, a log that begins
/// in the air or elsewhere.
geometry::EllipsoidalHeight takeoff_height(const flight::Telemetry& telemetry, const std::filesystem::path& log,
                                           const std::filesystem::path& truth);

}  // namespace tileflight::experiment
