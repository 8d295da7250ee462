#pragma once

#include <filesystem>
#include <functional>
#include <nlohmann/json.hpp>
#include <vector>

#include "tileflight/experiment/experiment_file.h"

namespace tileflight::experiment {

/// Flies an experiment's variants: runs an experiment into a folder and returns its results.json.
using VariantRun = std::function<nlohmann::json(const Variant& variant, const std::filesystem::path& folder)>;

/// What each variant costs: a list that begins with the simulated flight as it is (`results` of the run itself), then a
/// variant each, flown in RUN/variants/NAME: name, frames, frames_tracked, keyframes, points, correspondences, mean_m,
/// std_m (the paper's numbers), median_to_surface_m, ate_rmse_m, ate_share (of the path), and `failed` (why; the others
/// are null) where odometry found no map. What is not known is null. Also written as RUN/ablation.csv. Variants of an
/// earlier run that are not asked for any more are removed.
nlohmann::json fly_variants(const std::vector<Variant>& variants, const nlohmann::json& results,
                            const std::filesystem::path& run, const VariantRun& fly);

}  // namespace tileflight::experiment
