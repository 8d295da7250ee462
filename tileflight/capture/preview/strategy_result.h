#pragma once

#include <cstddef>
#include <filesystem>
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
                            const tileset::TilesetTree& tree, const CoverageSettings& settings,
                            const Progress& progress, std::vector<StrategyResult>& all);

/// Writes one frame as each strategy's tiles show it (`STRATEGY.png`; holes are black), and figure.png: view-follow
/// beside flight. `frame`: index into FrameSampling::frames.
void write_pictures(const std::filesystem::path& folder, const std::vector<StrategyResult>& all, std::size_t frame,
                    const FrameSampling& watch, CoverageContents& contents, const ContentIds& truth,
                    const CoverageSettings& settings);

}  // namespace tileflight::preview
