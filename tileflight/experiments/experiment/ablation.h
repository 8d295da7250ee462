#pragma once

#include <filesystem>
#include <functional>
#include <nlohmann/json_fwd.hpp>
#include <vector>

#include "tileflight/experiments/experiment/experiment_file.h"

namespace tileflight::experiment {

/// Runs the experiment of a variant into a folder and returns its results.json.
using VariantRunner = std::function<nlohmann::json(const Variant& variant, const std::filesystem::path& folder)>;

/// Runs an ablation: flies each variant in RUN/variants/NAME. Returns a list that starts with the unchanged simulated
/// flight (`results` of the run itself), then one entry per variant: name, frames, frames_tracked, keyframes, points,
/// correspondences, mean_m, std_m (the paper's numbers), median_to_surface_m, ate_rmse_m, ate_share (of the path
/// length), and `failed` (the cause; the others are null) if odometry found no map. Unknown values are null. Also
/// writes RUN/ablation.csv. Variants of an earlier run that are no longer requested are removed.
nlohmann::json run_variants(const std::vector<Variant>& variants, const nlohmann::json& results,
                            const std::filesystem::path& run, const VariantRunner& fly);

}  // namespace tileflight::experiment
