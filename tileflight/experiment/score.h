#pragma once

#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>

#include "tileflight/experiment/experiment_file.h"
#include "tileflight/geometry/geodesy.h"
#include "tileflight/geometry/progress.h"

namespace tileflight::experiment {

/// A map that is aligned and scored: an odometry folder (map.ply with trajectory.txt) or any cloud, and what is known
/// about its flight.
struct MapInputs {
  std::filesystem::path map;               ///< odometry folder, or .ply/.pcd/.xyz
  std::filesystem::path trajectory;        ///< estimated poses in the map's frame; empty: trajectory.txt of the folder
  std::filesystem::path truth_trajectory;  ///< true poses (TUM); empty: none
  std::filesystem::path gps;               ///< gps.csv; empty: none
  std::filesystem::path camera;            ///< calibration, for what the camera saw; empty: none
};

/// The inputs of a flight's folder (odometry/, dataset/).
MapInputs map_inputs(const std::filesystem::path& odometry_folder, const std::filesystem::path& dataset_folder);

/// Aligns a map to ground truth: trajectory to positions by Umeyama where both are known (gps.csv, else true poses),
/// then ICP. `target` is a folder that extract() wrote, or a cloud. With a folder, `to_surface` is the same alignment
/// refined against the triangles. Returns the content of transform.json and writes it to `out`. Throws InputError.
nlohmann::json align(const MapInputs& map, const std::filesystem::path& target,
                     const alignment::AlignMapOptions& options, const std::filesystem::path& out,
                     const Progress& progress = {});

/// Scores an aligned map against a folder that extract() wrote; writes metrics.json to `out` and the aligned map with
/// its distances beside it (errors.ply). Returns the content of metrics.json. Throws InputError.
nlohmann::json evaluate(const MapInputs& map, const std::filesystem::path& truth,
                        const std::filesystem::path& transform, const EvaluationSettings& settings,
                        const std::filesystem::path& out, const Progress& progress = {});

/// Two metrics.json (with errors.ply beside each) against each other. Throws InputError.
nlohmann::json compare(const std::filesystem::path& simulated, const std::filesystem::path& real,
                       const EvaluationSettings& settings, std::uint64_t seed);

}  // namespace tileflight::experiment
