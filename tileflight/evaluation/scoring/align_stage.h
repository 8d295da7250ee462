#pragma once

#include <filesystem>
#include <nlohmann/json_fwd.hpp>
#include <optional>

#include "tileflight/core/alignment/align_map.h"
#include "tileflight/core/base/progress.h"
#include "tileflight/core/geometry/geodesy.h"
#include "tileflight/evaluation/scoring/map_inputs.h"

namespace tileflight::scoring {

/// Aligns a map to ground truth: trajectory to positions by Umeyama if both are known (gps.csv, else true poses), then
/// ICP. The scale of a map whose odometry.json says that it is metric is held, and what the surface would choose is its
/// `scale_error`, unless the start is given. `target` is a folder written by extract(), or a point cloud. With a
/// folder, `to_surface` is the same alignment refined against the triangles. Returns the content of transform.json and
/// writes it to `out`. Throws InputError.
nlohmann::json align(const MapInputs& map, const std::filesystem::path& target,
                     const alignment::AlignMapOptions& options, const std::filesystem::path& out,
                     const Progress& progress = {});

}  // namespace tileflight::scoring
