#pragma once

#include <cstdint>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "tileflight/experiment/experiment_file.h"

namespace tileflight::experiment {

/// What the simulated flight told beforehand of the real one's failures, from a run folder (first runs):
/// `frames`: whether the same frames were lost (no pose in trajectory.txt), over pictures of one time; null where the
/// flights do not follow each other; `places`: whether the same places were missed, of those that both cameras saw
/// (evaluation::missed_places); null where there is no surface. Writes failure.json, missed-places.csv (a line a cell)
/// and lost-frames.csv (a line a frame that either lost) into the folder. Throws InputError.
nlohmann::json predict_failure(const std::filesystem::path& run, const EvaluationSettings& settings, bool follows,
                               std::uint64_t seed);

}  // namespace tileflight::experiment
