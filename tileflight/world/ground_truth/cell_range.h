#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>

#include "tileflight/core/geometry/voxel_grid.h"

namespace tileflight::ground_truth {

/// Cells from low to high, both included, along each axis; empty if high < low.
struct CellRange {
  std::array<std::int32_t, 3> low{}, high{};

  bool empty() const { return high[0] < low[0] || high[1] < low[1] || high[2] < low[2]; }
  bool contains(const geometry::Cell& cell) const {
    return cell.x >= low[0] && cell.x <= high[0] && cell.y >= low[1] && cell.y <= high[1] && cell.z >= low[2] &&
           cell.z <= high[2];
  }
  std::int64_t count(std::size_t axis) const { return std::int64_t{high[axis]} - low[axis] + 1; }
};

/// The part of a range inside a grid of `dims` cells.
inline CellRange clip_to_grid(const CellRange& range, const std::array<std::int32_t, 3>& dims) {
  CellRange inside;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    inside.low[axis] = std::max(range.low[axis], 0);
    inside.high[axis] = std::min(range.high[axis], dims[axis] - 1);
  }
  return inside;
}

inline CellRange whole_grid(const std::array<std::int32_t, 3>& dims) {
  return {{0, 0, 0}, {dims[0] - 1, dims[1] - 1, dims[2] - 1}};
}

/// The cells of both ranges.
inline CellRange intersection(const CellRange& a, const CellRange& b) {
  CellRange both;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    both.low[axis] = std::max(a.low[axis], b.low[axis]);
    both.high[axis] = std::min(a.high[axis], b.high[axis]);
  }
  return both;
}

}  // namespace tileflight::ground_truth
