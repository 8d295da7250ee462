#pragma once

#include <filesystem>
#include <string>

#include "tileflight/core/base/doubt.h"
#include "tileflight/evaluation/metrics/moving_points.h"
#include "tileflight/evaluation/scoring/map_inputs.h"
#include "tileflight/evaluation/scoring/tiled_scores.h"
#include "tileflight/world/place/extract_result.h"

namespace tileflight::scoring {

/// Reads the key `doubts` of a JSON file; empty if the file or the key is missing. Throws InputError.
Doubts read_doubts(const std::filesystem::path& json_file);

/// Doubts about a map before scoring: those of its odometry.json (its own doubts; tracking lost, frames without a
/// pose), and for external programs without odometry.json the completeness of the path.
Doubts odometry_doubts(const MapInputs& map);

/// Doubts about the ground truth: missing or coarse tiles (extract.json).
Doubts truth_doubts(const place::ExtractResult& extracted);

/// Doubts about the images: warnings of `render` or `ingest` (dataset.yaml).
Doubts dataset_doubts(const std::filesystem::path& dataset_folder);

/// A doubt if points on moving things are more than `share_margin` of the map. They are in no score, but the alignment
/// and the odometry used them; up to this share (EvaluationSettings::share_margin) no share of map points can differ by
/// more than what counts as equal, with or without them.
Doubts moving_doubts(const metrics::MovingPoints& moving, double share_margin);

/// A doubt if more than `share_margin` of a map's `points` lie exactly at one place: invalid points, which some systems
/// write to their file at the origin.
Doubts common_place_doubts(const CommonPlace& place, std::size_t points, double share_margin);

/// Appends doubts that are not yet in the list (compared by what and where).
void append_distinct(Doubts& doubts, const Doubts& more);

/// Prefixes each `where` with a flight's name, e.g. "real/odometry".
Doubts prefix_with_flight(Doubts doubts, const std::string& flight);

}  // namespace tileflight::scoring
