#pragma once

#include <cstdint>
#include <vector>

#include "tileflight/coverage/coverage_contents.h"
#include "tileflight/ground_truth/cell_sets.h"
#include "tileflight/tiles/placement.h"

namespace tileflight::coverage {

/// The region's cells that each content touches.
class CellCoverage {
 public:
  CellCoverage(const tiles::Region& region, double edge_m, std::size_t contents)
      : region_(region), edge_m_(edge_m), cells_(contents) {}

  void add(std::uint32_t id, const tiles::LoadedContent& content);

  std::uintmax_t bytes() const { return cells_.bytes(); }

  /// Once all contents are added: the occupied cells are those of the region's cut.
  void finish(const ContentIds& region_cut);

  std::int64_t occupied() const { return occupied_; }

  /// Of the occupied cells, the share that one of these has at most.
  double largest_share(const std::vector<ContentIds>& tiles) const;

 private:
  bool is_outside(const geometry::Vec3& center) const;

  tiles::Region region_;
  double edge_m_;
  ground_truth::CellSets cells_;
  ContentIds region_cut_;
  std::int64_t occupied_ = 0;
};

}  // namespace tileflight::coverage
