#pragma once

#include <filesystem>
#include <nlohmann/json_fwd.hpp>
#include <optional>

#include "tileflight/capture/flight_path/smooth_path.h"
#include "tileflight/core/base/progress.h"

namespace tileflight::recording {

/// Writes the FLIGHT file that repeats a scored flight. `real` holds its dataset, odometry and transform.json; the
/// poses are the estimates of all tracked images, transformed to the local frame, at the images' times, or those of
/// `located` (TUM, local frame) unless it is empty; the lens is the dataset's. `smoothing`: smoothing of the path along
/// the poses; too few poses to smooth are interpolated. `out` becomes a folder with flight.yaml, camera.yaml and
/// poses.txt. Throws InputError.
void write_followed_flight(const std::filesystem::path& real,
                           const std::optional<flight_path::SmoothingOptions>& smoothing,
                           const std::filesystem::path& out, const std::filesystem::path& located = {});

/// Measures how well a run's simulated flight reproduces the flight that it follows. Images are paired by time (within
/// half of the followed flight's frame interval); at most 200 evenly chosen pairs are evaluated. Per pair:
///   overlap    share of surface seen by both (capture/render/view_overlap.h), on the ground truth's mesh,
///   ncc, ssim  similarity of the images (core/imaging/image_similarity.h), inside the lens's image circle,
///   position_m, rotation_deg   pose difference, if the followed flight's true poses are known.
/// Per flight: medians, tenth percentiles, and
///   time_offset_s   delay of the simulated images that makes them most similar (mean ncc over shifts by whole frames,
///                   with a parabola through the best three); null if the best shift is at the end of the tested range,
///                   or no image has contrast,
///   excerpt         the longest sequence of pairs with an overlap of at least 0.8.
/// Poses of the followed flight are the true ones if known ("poses": "true"), else the estimated ones, which are also
/// those flown ("estimated": overlap and pose difference then say little). Reads RUN/real, RUN/simulated and RUN/truth;
/// writes RUN/reproduction.json, which is returned, and RUN/reproduction.csv. Throws InputError if no two images match
/// in time.
nlohmann::json measure_reproduction(const std::filesystem::path& run, const Progress& progress = {});

}  // namespace tileflight::recording
