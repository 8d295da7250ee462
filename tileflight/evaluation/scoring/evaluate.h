#pragma once

#include <filesystem>

#include "tileflight/core/base/progress.h"
#include "tileflight/evaluation/metrics/metrics_file.h"
#include "tileflight/evaluation/scoring/evaluation_settings.h"
#include "tileflight/evaluation/scoring/map_inputs.h"
#include "tileflight/evaluation/scoring/seen_surface.h"

namespace tileflight::scoring {

/// The file in which evaluate() stores the map's points on actors, which errors.ply does not have, with the same
/// scalars; only if there are any.
std::filesystem::path moving_points_file(const std::filesystem::path& metrics_json);

/// Scores an aligned map against a folder written by extract(). Points on the actors of the map's dataset are in no
/// score (find_points_on_actors()). Writes metrics.json to `out`, and beside it the aligned map with its distances
/// (errors.ply), seen_surface_file() and moving_points_file(). Throws InputError.
metrics::Metrics evaluate(const MapInputs& map, const std::filesystem::path& truth,
                          const std::filesystem::path& transform, const EvaluationSettings& settings,
                          const std::filesystem::path& out, const Progress& progress = {});

}  // namespace tileflight::scoring
