#pragma once

#include <cstdint>
#include <vector>

#include "tileflight/core/geometry/transform.h"

namespace tileflight::tile_writer {

/// A balanced tree of cells over weighted points (a k-d tree; Bentley 1975). Each cell is split into halves of equal
/// weight across its longest extent, and each half again, so that a cell has four children and all leaves have the same
/// depth. Cells of a level are numbered so that cell i has the children 4 i to 4 i + 3.
class CellTree {
 public:
  /// `places` and `weights`: one per item; `depth`: levels below the root, at most 12. The result does not depend on
  /// the number of threads.
  CellTree(const std::vector<geometry::Vec3>& places, const std::vector<float>& weights, int depth);
  /// Makes a tree whose cells are split one after the other by split(), from the root down.
  explicit CellTree(int depth);

  /// Splits a cell of `level` into its descendants of `to_level` by the items in it. Returns the items of each of the
  /// 4^(to_level - level) descendants, ascending. Different cells may be split at the same time.
  std::vector<std::vector<std::uint32_t>> split(std::uint32_t cell, int level, int to_level,
                                                const std::vector<geometry::Vec3>& places,
                                                const std::vector<float>& weights);

  /// Returns the items of each leaf, ascending: 4^depth leaves, of which some may be empty. Empty if the cells were
  /// split one by one.
  const std::vector<std::vector<std::uint32_t>>& leaves() const { return leaves_; }
  /// Returns the cell of a level (0: root) that contains a point.
  std::uint32_t cell_of(const geometry::Vec3& place, int level) const { return cell_of(place, level, 0, 0); }
  /// Returns the cell of a level that a point belongs to among the descendants of cell `from` of `from_level`, which
  /// need not contain the point.
  std::uint32_t cell_of(const geometry::Vec3& place, int level, std::uint32_t from, int from_level) const;

 private:
  /// Points with a smaller coordinate than `value` lie in the first half.
  struct Split {
    int axis = 0;
    double value = 0.0;
  };
  struct Items;

  void split(const Items& items, std::size_t begin, std::size_t end, std::size_t node);

  std::vector<Split> splits_;  ///< two per level, as a heap: node 1 is the root, the halves of n are 2 n and 2 n + 1
  std::vector<std::vector<std::uint32_t>> leaves_;
};

}  // namespace tileflight::tile_writer
