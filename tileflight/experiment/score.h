#pragma once

#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>

#include "tileflight/experiment/experiment_file.h"
#include "tileflight/experiment/map_inputs.h"
#include "tileflight/geometry/geodesy.h"
#include "tileflight/geometry/progress.h"

namespace tileflight::experiment {

/// Aligns a map to ground truth: trajectory to positions by Umeyama where both are known (gps.csv, else true poses),
/// then ICP. `target` is a folder that extract() wrote, or a cloud. With a folder, `to_surface` is the same alignment
/// refined against the triangles. Returns the content of transform.json and writes it to `out`. Throws InputError.
nlohmann::json align(const MapInputs& map, const std::filesystem::path& target,
                     const alignment::AlignMapOptions& options, const std::filesystem::path& out,
                     const Progress& progress = {});

}  // namespace tileflight::experiment
