#pragma once

#include <filesystem>
#include <optional>

#include "tileflight/flight/smoothing.h"

namespace tileflight::experiment {

/// Writes the FLIGHT file that flies a scored flight again: `real` holds its dataset, odometry and transform.json; the
/// poses are the estimated ones of all tracked pictures, moved to the local frame, at the pictures' times; the lens is
/// the dataset's. `smoothing`: of the path along the poses (fewer poses than that needs are flown through as they are).
/// `out` becomes a folder with flight.yaml, camera.yaml and poses.txt. Throws InputError.
void write_followed_flight(const std::filesystem::path& real, const std::optional<flight::SmoothingOptions>& smoothing,
                           const std::filesystem::path& out);

}  // namespace tileflight::experiment
