#pragma once

#include <functional>
#include <string>
#include <vector>

#include "tileflight/core/imaging/camera.h"
#include "tileflight/tiles/tileset/placement.h"
#include "tileflight/tiles/tileset/view_criteria.h"

namespace tileflight::preview {

/// A strategy that decides which tiles are loaded for a flight's frames.
struct TileStrategy {
  std::string name;
  std::string description;
  bool is_fixed = false;  ///< one set of tiles for all frames
  /// Refinement criterion for a camera pose (camera to local).
  std::function<tileset::RefinementCriterion(const geometry::SE3&)> criterion;
};

/// The frames' lens and poses, and the strategies' parameters.
struct StrategySettings {
  imaging::Camera camera;  ///< the flight's camera at full size
  std::vector<geometry::SE3> T_local_camera;
  tileset::Region region;
  geometry::SE3 T_local_tileset;
  double error_m = 0.0;   ///< tiles of at most this error are never refined
  double error_px = 1.0;  ///< for `flight`
  double follow_height_m = 50.0;
  tileset::ViewerCamera viewer;  ///< image size, field of view and error of the two viewers; its pose is ignored
};

/// view-follow, view-high, sensor, flight, region (see coverage.h), in this order.
std::vector<TileStrategy> make_tile_strategies(const StrategySettings& settings);

/// Criterion for everything that the flight sees, at the finest error that counts.
tileset::RefinementCriterion full_detail_criterion(const StrategySettings& settings);

}  // namespace tileflight::preview
