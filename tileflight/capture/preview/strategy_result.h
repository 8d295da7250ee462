#pragma once

#include <cstddef>
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "tileflight/capture/preview/coverage_contents.h"
#include "tileflight/capture/preview/pixel_counts.h"
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

/// Makes the strategies view-follow, view-high, sensor, flight and region (see coverage.h), in this order.
std::vector<TileStrategy> make_tile_strategies(const StrategySettings& settings);

/// Returns the criterion for everything that the flight sees, at the finest error that counts.
tileset::RefinementCriterion full_detail_criterion(const StrategySettings& settings);

/// The tiles of a strategy and the resulting counts.
struct StrategyResult {
  TileStrategy strategy;
  std::vector<ContentIds> tiles;    ///< per frame; a single entry if the strategy is fixed
  std::vector<PixelCounts> shares;  ///< per frame
  double cells_share = 0.0;

  const ContentIds& tiles_at(std::size_t frame) const { return tiles[strategy.is_fixed ? 0 : frame]; }
};

/// Returns the frame, as an index into FrameSampling::frames, of which most pixels are missing.
std::size_t worst_frame(const StrategyResult& result);

/// Counts the pixels of each frame for each strategy. `truth`: contents of the finest cut of all that is visible. The
/// scene is traced in parts that fit into memory, for as many frames at once as do.
void count_pixels_of_frames(const FrameSampling& watch, CoverageContents& contents, const ContentIds& truth,
                            const tileset::TilesetTree& tree, const CoverageSettings& settings,
                            const Progress& progress, std::vector<StrategyResult>& all);

/// Writes one frame as each strategy's tiles show it (`STRATEGY.png`; holes are black), and figure.png: view-follow
/// beside flight. `frame`: index into FrameSampling::frames.
void write_pictures(const std::filesystem::path& folder, const std::vector<StrategyResult>& all, std::size_t frame,
                    const FrameSampling& watch, CoverageContents& contents, const ContentIds& truth,
                    const CoverageSettings& settings);

}  // namespace tileflight::preview
