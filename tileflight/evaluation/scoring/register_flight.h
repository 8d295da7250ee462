#pragma once

#include <nlohmann/json_fwd.hpp>

#include "tileflight/core/alignment/align_map.h"
#include "tileflight/core/base/progress.h"
#include "tileflight/evaluation/scoring/align_target.h"
#include "tileflight/evaluation/scoring/map_inputs.h"

namespace tileflight::scoring {

/// Registers a map to a ground truth with a surface, using all data of its flight (register_map.h): shapes, telemetry,
/// and images if the truth has textures. Returns the content of transform.json: the registration, its warnings, and
/// `published`, the paper's last step starting from it. Throws InputError.
nlohmann::json register_flight(const MapInputs& map, const AlignTarget& target,
                               const alignment::AlignMapOptions& options, const Progress& progress = {});

}  // namespace tileflight::scoring
