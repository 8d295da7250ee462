#pragma once

#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>

#include "tileflight/experiment/track_extras.h"
#include "tileflight/geometry/progress.h"
#include "tileflight/odometry/odometry.h"
#include "tileflight/odometry/options.h"

namespace tileflight::experiment {

/// Which frames of a dataset, by index.
struct FrameRange {
  std::size_t from = 0;
  std::optional<std::size_t> to;  ///< exclusive
  std::size_t every = 1;
  bool reverse = false;
};

/// Runs our odometry over a dataset folder and writes trajectory.txt, keyframes.txt, map.ply, camera.yaml (of the
/// pictures as they were tracked), quality.csv (a line a picture) and odometry.json (returned, with `doubts`) as a
/// whole folder. The dataset's ground truth and positions are not looked at. A run that was lost is written as far as
/// it went, with `lost` true; one that never began has an empty trajectory and no map points. A picture that cannot be
/// decoded is left out, counted and warned of. Throws InputError for a dataset, mask or start that cannot be read, and
/// for a lens that COLMAP does not know when its format was asked for.
nlohmann::json track(const std::filesystem::path& dataset_folder, const std::filesystem::path& out, bool replace,
                     const odometry::OdometryOptions& options, const FrameRange& range, const Progress& progress = {},
                     const TrackExtras& extras = {});

/// The same by an outside program: a shell command with {dataset} and {out} filled in (each quoted for the shell),
/// which runs in `folder`. It must leave trajectory.txt and map.ply in {out}; odometry.json is written if it leaves
/// none. Throws InputError when the command fails or leaves none.
nlohmann::json track_with_command(const std::filesystem::path& dataset_folder, const std::filesystem::path& out,
                                  bool replace, const std::string& command, const std::filesystem::path& folder);

}  // namespace tileflight::experiment
