#pragma once

#include <functional>
#include <string>
#include <vector>

#include "tileflight/imaging/camera.h"
#include "tileflight/tiles/placement.h"
#include "tileflight/tiles/viewing.h"

namespace tileflight::experiment {

/// A way to decide which tiles are in memory while a flight's frames are taken.
struct TileStrategy {
  std::string name;
  std::string about;
  bool is_fixed = false;  ///< the same tiles for all frames
  /// What is wanted while the camera is at a pose (camera to local).
  std::function<tiles::Wanted(const geometry::SE3&)> wanted;
};

/// The frames' lens and poses, and what the strategies are set to.
struct StrategySettings {
  imaging::Camera camera;  ///< of the flight, in full size
  std::vector<geometry::SE3> T_local_camera;
  tiles::Region region;
  geometry::SE3 T_local_tileset;
  double error_m = 0.0;   ///< tiles of at most this error are never refined
  double error_px = 1.0;  ///< of `flight`
  double follow_height_m = 50.0;
  tiles::ViewerCamera viewer;  ///< picture size, field of view and error of the two viewers; its pose is not heeded
};

/// view-follow, view-high, sensor, flight, region (see coverage.h), in this order.
std::vector<TileStrategy> tile_strategies(const StrategySettings& settings);

/// Everything that the flight looks at, as fine as counts.
tiles::Wanted everything_seen(const StrategySettings& settings);

}  // namespace tileflight::experiment
