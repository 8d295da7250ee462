#pragma once

#include <cstddef>
#include <vector>

#include "tileflight/capture/preview/coverage_contents.h"
#include "tileflight/capture/preview/frame_sampling.h"
#include "tileflight/capture/preview/pixel_counts.h"
#include "tileflight/capture/preview/tile_strategies.h"

namespace tileflight::preview {

/// The tiles of a strategy and the resulting counts.
struct StrategyResult {
  TileStrategy strategy;
  std::vector<ContentIds> tiles;    ///< per frame; a single entry if the strategy is fixed
  std::vector<PixelCounts> shares;  ///< per frame
  double cells_share = 0.0;

  const ContentIds& tiles_at(std::size_t frame) const { return tiles[strategy.is_fixed ? 0 : frame]; }
};

/// The frame, as an index into FrameSampling::frames, of which most pixels are missing.
std::size_t worst_frame(const StrategyResult& result);

/// Counts the pixels of each frame for each strategy. `truth`: contents of the finest cut of all that is visible. The
/// scene is traced in parts that fit into memory, for as many frames at once as do.
void count_pixels_of_frames(const FrameSampling& watch, CoverageContents& contents, const ContentIds& truth,
                            const tileset::TilesetTree& tree, const CoverageSettings& settings, const Progress& progress,
                            std::vector<StrategyResult>& all);

}  // namespace tileflight::preview
