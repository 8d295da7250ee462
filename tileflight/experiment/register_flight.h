#pragma once

#include <nlohmann/json.hpp>

#include "tileflight/alignment/align_map.h"
#include "tileflight/experiment/align_target.h"
#include "tileflight/experiment/map_inputs.h"
#include "tileflight/geometry/progress.h"

namespace tileflight::experiment {

/// A map's registration to a ground truth with a surface by all that is known of its flight (register_map.h): shapes,
/// telemetry, and its pictures where the truth has textures. The content of transform.json: the registration, its
/// doubts, and `published`, the paper's last step from there. Throws InputError.
nlohmann::json register_flight(const MapInputs& map, const AlignTarget& target,
                               const alignment::AlignMapOptions& options, const Progress& progress = {});

}  // namespace tileflight::experiment
