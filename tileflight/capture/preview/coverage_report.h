#pragma once

#include <cstdint>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "tileflight/capture/preview/coverage_contents.h"
#include "tileflight/capture/preview/strategy_result.h"
#include "tileflight/tiles/tileset/placement.h"
#include "tileflight/world/ground_truth/cell_sets.h"

namespace tileflight::preview {

/// The region's cells that each content touches.
class CellCoverage {
 public:
  CellCoverage(const tileset::Region& region, double edge_m, std::size_t contents)
      : region_(region), edge_m_(edge_m), cells_(contents) {}

  void add(std::uint32_t id, const tileset::LoadedContent& content);

  std::uintmax_t bytes() const { return cells_.bytes(); }

  /// Once all contents are added: the occupied cells are those of the region's cut.
  void finish(const ContentIds& region_cut);

  std::int64_t occupied() const { return occupied_; }

  /// Of the occupied cells, the share that one of these has at most.
  double largest_share(const std::vector<ContentIds>& tiles) const;

 private:
  bool is_outside(const geometry::Vec3& center) const;

  tileset::Region region_;
  double edge_m_;
  ground_truth::CellSets cells_;
  ContentIds region_cut_;
  std::int64_t occupied_ = 0;
};

/// What coverage.json holds of all strategies.
nlohmann::json result_json(const CoverageSettings& settings, const FrameSampling& watch,
                           const std::vector<StrategyResult>& all, const CoverageContents& contents,
                           const ContentIds& truth, const CellCoverage& cells);

/// frames.csv: the shares of each frame by each strategy.
std::string frames_csv(const std::vector<StrategyResult>& all, const FrameSampling& watch);

}  // namespace tileflight::preview
