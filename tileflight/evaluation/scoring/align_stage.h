#pragma once

#include <filesystem>

#include "tileflight/core/alignment/align_map.h"
#include "tileflight/core/base/progress.h"
#include "tileflight/evaluation/scoring/align_result.h"
#include "tileflight/evaluation/scoring/map_inputs.h"

namespace tileflight::scoring {

/// Aligns a map to `target`: a folder written by extract(), or a point cloud. A ground truth with a surface is aligned
/// to with all evidence (register_flight()) unless the options exclude it. Otherwise the trajectory is aligned to
/// positions by Umeyama if both are known (gps.csv, else true poses), and ICP follows.
///
/// The scale of a map whose odometry.json says that it is metric is held, unless the start is given. Writes
/// transform.json to `out`. Throws InputError.
AlignResult align(const MapInputs& map, const std::filesystem::path& target, const alignment::AlignMapOptions& options,
                  const std::filesystem::path& out, const Progress& progress = {});

}  // namespace tileflight::scoring
