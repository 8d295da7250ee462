#pragma once

#include <cstdint>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>

#include "tileflight/geometry/progress.h"
#include "tileflight/tiles/load.h"

namespace tileflight::experiment {

/// What `tileflight coverage` asks.
struct CoverageSettings {
  std::string source;            ///< SOURCE of the contract
  tiles::LoadOptions load;       ///< region whose cells are counted; the finest geometric error that counts; origin
  std::filesystem::path flight;  ///< FLIGHT file
  double error_px = 1.0;         ///< a pixel whose tile errs by no more than this is right
  int frames = 60;               ///< so many frames are looked at, evenly over the flight
  int width = 320;               ///< of the picture whose pixels are counted
  int picture_width = 1008;      ///< of the pictures that are written
  double voxel_m = 1.0;
  double follow_height_m = 50.0;      ///< of view-follow's camera above the drone
  double viewer_fov_deg = 90.0;       ///< horizontal, of the two viewers (Unreal's default)
  double viewer_max_error_px = 16.0;  ///< Cesium's default screen-space error
  int viewer_width = 1920, viewer_height = 1080;
};

/// What each strategy of loading tiles gives each frame of a flight, whose lens is the sensor:
///
///   view-follow  a viewer's camera above the drone that looks straight down, as a game engine's main camera follows
///   view-high    the paper's cure: a viewer's camera high above the region, which fills its view
///   sensor       a viewer with the sensor's own pose and field of view (as a pinhole; at most 170 degrees)
///   flight       one cut for all frames, every pixel at most `error_px` wrong
///   region       one cut that covers the region at the error asked for
///
/// The truth is the finest cut of everything that the flight looks at. Each pixel's central ray meets a triangle of a
/// tile there; a strategy shows that pixel *right* when it holds that tile or one above it whose error there is at most
/// `error_px`, *coarser* when it holds one whose error is larger, and else it is *missing*: a hole. Pixels that meet
/// nothing are not counted. Also counted: tiles and bytes, memory once decoded, and the share of the region's occupied
/// cells that the strategy's tiles touch, at the frame where that is most (what one would extract at the best moment).
///
/// Writes coverage.json (returned), frames.csv, and at the frame where view-follow misses most a picture by each
/// strategy's tiles (holes are black) and figure.png (view-follow beside flight) into `out`, whole or not at all.
/// Throws InputError.
nlohmann::json coverage(const CoverageSettings& settings, const std::filesystem::path& out, bool replace,
                        const Progress& progress = {});

}  // namespace tileflight::experiment
