#pragma once

#include <filesystem>
#include <string>

#include "tileflight/core/base/warning.h"
#include "tileflight/core/geometry/trajectory.h"
#include "tileflight/evaluation/metrics/moving_points.h"
#include "tileflight/evaluation/registration/register_map.h"
#include "tileflight/evaluation/scoring/map_inputs.h"
#include "tileflight/evaluation/scoring/tiled_scores.h"
#include "tileflight/world/place/extract_result.h"

namespace tileflight::scoring {

/// Lowers to Severity::kNote the warnings of odometry about its path as a whole (`path_warnings` of odometry.json: its
/// directions disagree, the scale may have drifted) if images of the flight confirm that path. They do if at least nine
/// of ten tried images, each located in the place on its own, differ from the path's best fit by at most half a percent
/// of its length (RMS).
void answer_path_warnings(const MapInputs& map, const registration::PictureAgreement& pictures, Warnings& warnings);

/// Reads the key `warnings` of a JSON file; empty if the file or the key is missing. Throws InputError.
Warnings read_warnings(const std::filesystem::path& json_file);

/// Returns the warnings about a map before scoring: those of its odometry.json (its own warnings; tracking lost, frames
/// without a pose), and for external programs without odometry.json the completeness of the path.
Warnings odometry_warnings(const MapInputs& map);

/// Returns a warning about the times within a trajectory at which it has no poses (metrics::find_time_gaps()).
/// `duration_s`: of the flight; `unrecorded`: the gaps of its images or true poses.
Warnings gap_warnings(const geometry::Trajectory& trajectory, double duration_s,
                      const std::vector<metrics::TimeGap>& unrecorded, const std::string& where);

/// Warnings about the ground truth: missing or coarse tiles (extract.json).
Warnings truth_warnings(const place::ExtractResult& extracted);

/// Returns the warnings about the images, which `render` or `ingest` wrote to dataset.yaml.
Warnings dataset_warnings(const std::filesystem::path& dataset_folder);

/// Returns a warning if points on moving objects are more than `share_margin` of the map. They are in no score, but the
/// alignment and the odometry used them. Up to this share (EvaluationSettings::share_margin) no share of map points can
/// differ by more than what counts as equal, with or without them.
Warnings moving_warnings(const metrics::MovingPoints& moving, double share_margin);

/// Returns a warning if more than `share_margin` of a map's `points` lie exactly at one place. These are invalid
/// points, which some systems write to their file at the origin.
Warnings common_place_warnings(const CommonPlace& place, std::size_t points, double share_margin);

/// Appends the warnings that are not yet in the list (compared by message and where).
void append_distinct(Warnings& warnings, const Warnings& more);

/// Prefixes each `where` with a flight's name, e.g. "real/odometry".
Warnings prefix_with_flight(Warnings warnings, const std::string& flight);

}  // namespace tileflight::scoring
