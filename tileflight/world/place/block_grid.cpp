#include "tileflight/world/place/block_grid.h"

#include <algorithm>
#include <cmath>

#include "tileflight/core/base/formatted_text.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/world/ground_truth/voxelize.h"

namespace tileflight::place {

using geometry::Box3;
using geometry::Vec3;

BlockGrid::BlockGrid(const Box3& region, double voxel_m, std::int32_t edge)
    : region_(region), voxel_m_(voxel_m), edge_(edge), dims_(ground_truth::grid_dims(region, voxel_m)) {
  constexpr double kMostBlocks = 1e6;
  if (std::ceil(static_cast<double>(dims_[0]) / edge) * std::ceil(static_cast<double>(dims_[1]) / edge) > kMostBlocks) {
    throw InputError("--block " + base::trimmed_text(edge_m(), 3) + " m",
                     "would give more than a million blocks: choose a larger edge, in metres");
  }
  for (std::int32_t x = 0; x < dims_[0]; x += edge) {
    for (std::int32_t y = 0; y < dims_[1]; y += edge)
      blocks_.push_back(
          {{x, y, 0}, {std::min(x + edge, dims_[0]) - 1, std::min(y + edge, dims_[1]) - 1, dims_[2] - 1}});
  }
}

std::string BlockGrid::name(std::size_t block) const {
  return base::formatted("x%05d_y%05d", blocks_[block].low[0] / edge_, blocks_[block].low[1] / edge_);
}

Box3 BlockGrid::reach(std::size_t block, std::int32_t border) const {
  const auto corner = [&](const std::array<std::int32_t, 3>& cell, double shift) {
    return Vec3(region_.min() + voxel_m_ * (Vec3(cell[0], cell[1], cell[2]) + Vec3::Constant(shift)));
  };
  return {corner(blocks_[block].low, -border - 0.6), corner(blocks_[block].high, border + 1.6)};
}

Box3 BlockGrid::bounds(std::size_t block) const {
  const Box3 own = reach(block, 0);
  const Vec3 slack = Vec3::Constant(0.6 * voxel_m_);
  return {own.min() + slack, own.max() - slack};
}

std::int32_t edge_in_cells(double edge_m, double voxel_m) {
  return static_cast<std::int32_t>(std::clamp(std::round(edge_m / voxel_m), 1.0, static_cast<double>(1 << 24)));
}

}  // namespace tileflight::place
