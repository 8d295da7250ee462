#pragma once

// Whether quality.csv's standard deviations are right: errors of each picture's pose relative to its keyframe, over
// the sigma that is stated of it.

#include <filesystem>
#include <optional>

#include "tileflight/core/geometry/trajectory.h"

namespace tileflight::proving_ground {

/// Mean over the pictures of squared error over squared sigma. 1: honest.
struct PathSigmas {
  double position = 0.0, rotation = 0.0;
};

/// `odometry`: a folder with trajectory.txt, quality.csv and odometry.json. The map's scale is the one that carries all
/// positions best. nullopt where fewer than ten pictures have a sigma, and where the flight was tracked in one
/// direction only (`dispersion` is null): sigmas are not the flight's own then. Throws InputError for malformed files.
std::optional<PathSigmas> path_sigmas(const std::filesystem::path& odometry, const geometry::Trajectory& truth);

}  // namespace tileflight::proving_ground
