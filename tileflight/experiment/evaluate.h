#pragma once

#include <filesystem>
#include <nlohmann/json.hpp>

#include "tileflight/evaluation/missed_places.h"
#include "tileflight/experiment/experiment_file.h"
#include "tileflight/experiment/map_inputs.h"
#include "tileflight/geometry/progress.h"

namespace tileflight::experiment {

/// Where evaluate() leaves the samples of the true surface that the flight's camera saw, with the scalar
/// `map_distance`: metres to the nearest map point over the region.
std::filesystem::path seen_file(const std::filesystem::path& metrics_json);

/// Scores an aligned map against a folder that extract() wrote; writes metrics.json to `out` and the aligned map with
/// its distances (errors.ply) and seen_file() beside it. Returns the content of metrics.json. Throws InputError.
nlohmann::json evaluate(const MapInputs& map, const std::filesystem::path& truth,
                        const std::filesystem::path& transform, const EvaluationSettings& settings,
                        const std::filesystem::path& out, const Progress& progress = {});

/// The samples of seen_file(), each with its distance to the map. Throws InputError.
evaluation::SeenSurface read_seen(const std::filesystem::path& seen_ply);

}  // namespace tileflight::experiment
