#pragma once

#include <cstddef>
#include <filesystem>
#include <vector>

#include "tileflight/capture/preview/strategy_result.h"

namespace tileflight::preview {

/// Writes one frame as each strategy's tiles show it (`STRATEGY.png`; holes are black), and figure.png: view-follow
/// beside flight. `frame`: index into FrameSampling::frames.
void write_pictures(const std::filesystem::path& folder, const std::vector<StrategyResult>& all, std::size_t frame,
                    const FrameSampling& watch, CoverageContents& contents, const ContentIds& truth,
                    const CoverageSettings& settings);

}  // namespace tileflight::preview
