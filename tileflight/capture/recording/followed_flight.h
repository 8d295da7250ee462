#pragma once

#include <filesystem>
#include <optional>

#include "tileflight/capture/flight_path/smooth_path.h"

namespace tileflight::recording {

/// Writes the FLIGHT file that repeats a scored flight. `real` holds its dataset, odometry and transform.json; the
/// poses are the estimates of all tracked images, transformed to the local frame, at the images' times; the lens is the
/// dataset's. `smoothing`: of the path along the poses (with too few poses to smooth, the path interpolates them).
/// `out` becomes a folder with flight.yaml, camera.yaml and poses.txt. Throws InputError.
void write_followed_flight(const std::filesystem::path& real,
                           const std::optional<flight_path::SmoothingOptions>& smoothing,
                           const std::filesystem::path& out);

}  // namespace tileflight::recording
