#pragma once

// Writes a TrackResult: odometry.json and the other files of an odometry's folder (docs/formats.md).

#include <filesystem>
#include <nlohmann/json_fwd.hpp>
#include <vector>

#include "tileflight/data/dataset/dataset.h"
#include "tileflight/slam/odometry/track.h"

namespace tileflight::odometry {

/// Returns the content of odometry.json.
nlohmann::json to_json(const TrackResult& result);

/// Writes quality.csv, trajectory.txt, keyframes.txt, map.ply, camera.yaml, odometry.json, and inertial.csv if the
/// inertial unit showed the scale. `frames`: the images in the order of the flight, which is that of the result.
void write_track_result(const std::filesystem::path& folder, const TrackResult& result,
                        const std::vector<dataset::Frame>& frames);

/// Reads quality.csv: an entry for each image in order of time. FrameQuality::frame is the number of its line, from 0;
/// `keyframe` is not stored. Throws InputError (file, line, cause).
std::vector<FrameQuality> read_quality_csv(const std::filesystem::path& file);

}  // namespace tileflight::odometry
