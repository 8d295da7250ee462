#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "tileflight/capture/preview/cell_coverage.h"
#include "tileflight/capture/preview/strategy_result.h"

namespace tileflight::preview {

/// What coverage.json holds of all strategies.
nlohmann::json result_json(const CoverageSettings& settings, const FrameSampling& watch,
                           const std::vector<StrategyResult>& all, const CoverageContents& contents,
                           const ContentIds& truth, const CellCoverage& cells);

/// frames.csv: the shares of each frame by each strategy.
std::string frames_csv(const std::vector<StrategyResult>& all, const FrameSampling& watch);

}  // namespace tileflight::preview
