#pragma once

#include <cstddef>
#include <filesystem>
#include <vector>

#include "tileflight/coverage/strategy_result.h"

namespace tileflight::coverage {

/// Writes one frame as each strategy's tiles show it (`STRATEGY.png`; holes are black), and figure.png: view-follow
/// beside flight. `frame`: index into FrameSampling::frames.
void write_pictures(const std::filesystem::path& folder, const std::vector<StrategyResult>& all, std::size_t frame,
                    const FrameSampling& watch, CoverageContents& contents, const ContentIds& truth,
                    const CoverageSettings& settings);

}  // namespace tileflight::coverage
