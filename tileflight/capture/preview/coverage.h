#pragma once

#include <cstdint>
#include <filesystem>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <vector>

#include "tileflight/core/base/progress.h"
#include "tileflight/tiles/tileset/load.h"

namespace tileflight::preview {

/// Settings of `tileflight coverage`.
struct CoverageSettings {
  std::string source;            ///< SOURCE of the contract
  tileset::LoadOptions load;     ///< region whose cells are counted, finest geometric error that counts, origin
  std::filesystem::path flight;  ///< FLIGHT file
  double error_px = 1.0;         ///< largest error of a tile, in pixels, at which a pixel counts as right
  int frames = 60;               ///< number of frames evaluated, evenly spread over the flight
  int width = 320;               ///< width of the images whose pixels are counted
  int picture_width = 1008;      ///< width of the written images
  double voxel_m = 1.0;
  /// Memory limit for tiles; default: base::default_memory_bytes(). The result does not depend on it.
  std::optional<std::uintmax_t> max_memory_bytes = {};
  double follow_height_m = 50.0;      ///< height of view-follow's camera above the drone
  double viewer_fov_deg = 90.0;       ///< horizontal field of view of the two viewers (Unreal's default)
  double viewer_max_error_px = 16.0;  ///< Cesium's default screen-space error
  int viewer_width = 1920, viewer_height = 1080;
};

/// Compares which tiles each loading strategy provides for the frames of a flight through the sensor's lens:
///
///   view-follow  a viewer's camera above the drone, looking straight down, as a game engine's main camera follows
///   view-high    the paper's remedy: a viewer's camera high above the region, which fills its view
///   sensor       a viewer with the sensor's own pose and field of view (as a pinhole; at most 170 degrees)
///   flight       one cut for all frames, with an error of at most `error_px` in every pixel
///   region       one cut that covers the region at the requested error
///
/// The reference is the finest cut of everything visible in the flight. Each pixel's central ray hits a triangle of one
/// of its tiles. A strategy shows that pixel *right* if it has loaded that tile, or an ancestor whose error there is at
/// most `error_px`; *coarser* if it has loaded one with a larger error; otherwise the pixel is *missing*: a hole.
/// Pixels that hit nothing are not counted. Also counted: tiles and bytes, memory once decoded, and the share of the
/// region's occupied cells that the strategy's tiles touch, at the frame where that share is largest (an extraction at
/// the best moment).
///
/// Writes coverage.json (returned; `warnings`: what was assumed of a mission), frames.csv, and for the frame where
/// view-follow misses most an image with each strategy's tiles (holes are black) and figure.png (view-follow beside
/// flight) into `out`, atomically. Throws InputError.
nlohmann::json measure_coverage(const CoverageSettings& settings, const std::filesystem::path& out, bool replace,
                                const Progress& progress = {});

}  // namespace tileflight::preview
