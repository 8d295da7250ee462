#pragma once

#include "tileflight/core/alignment/align_map.h"
#include "tileflight/core/base/progress.h"
#include "tileflight/evaluation/scoring/align_result.h"
#include "tileflight/evaluation/scoring/align_target.h"
#include "tileflight/evaluation/scoring/map_inputs.h"

namespace tileflight::scoring {

/// Registers a map to a ground truth with a surface, using all data of its flight (register_map.h): shapes, telemetry,
/// and images if the ground truth has textures. The warnings of the result include those of the map's odometry. Throws
/// InputError.
RegisteredFlight register_flight(const MapInputs& map, const AlignTarget& target,
                                 const alignment::AlignMapOptions& options, const Progress& progress = {});

}  // namespace tileflight::scoring
