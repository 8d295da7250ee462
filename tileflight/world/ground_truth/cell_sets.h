#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "tileflight/core/geometry/voxel_grid.h"

namespace tileflight::ground_truth {

/// Many sets of cells of one grid, in little memory: a cell that follows another takes about one byte.
class CellSets {
 public:
  using Numbers = std::vector<std::uint32_t>;  ///< of sets

  explicit CellSets(std::size_t sets) : steps_(sets) {}

  /// Sets a set to the grid's occupied cells. Precondition: the dimensions are those of the sets before.
  void set(std::size_t number, const geometry::VoxelGrid& grid);

  /// Returns for each of `parts` how many cells of the sets `whole` together are in its sets, too.
  std::vector<std::int64_t> count_covered(const Numbers& whole, std::span<const Numbers> parts) const;

  std::uintmax_t bytes() const { return bytes_; }

 private:
  class Cursor;
  class Slab;

  std::array<std::int32_t, 3> dims_{};
  /// Differences of each set's cell numbers, (x * dims y + y) * dims z + z, seven bits a byte, lowest first, the eighth
  /// bit set in all bytes but a number's last (LEB128).
  std::vector<std::vector<std::uint8_t>> steps_;
  std::uintmax_t bytes_ = 0;
};

}  // namespace tileflight::ground_truth
