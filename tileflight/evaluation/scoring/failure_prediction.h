#pragma once

#include <cstdint>
#include <filesystem>
#include <nlohmann/json_fwd.hpp>

#include "tileflight/evaluation/scoring/evaluation_settings.h"

namespace tileflight::scoring {

/// Evaluates how well a run's simulated flight predicts the real one's failures (first runs): `frames`: whether the
/// same frames were lost (no pose in trajectory.txt), over images of equal time; null if the flights do not follow each
/// other; `places`: whether the same places were missed, among those that both cameras saw (metrics::missed_places);
/// null if there is no surface. Writes failure.json, missed-places.csv (a line per cell) and lost-frames.csv (a line
/// per frame lost by either) into the folder. Throws InputError.
nlohmann::json predict_failure(const std::filesystem::path& run, const EvaluationSettings& settings, bool follows,
                               std::uint64_t seed);

}  // namespace tileflight::scoring
