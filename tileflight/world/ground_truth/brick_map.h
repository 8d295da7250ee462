#pragma once

#include <array>
#include <bit>
#include <cstdint>
#include <vector>

#include "tileflight/core/geometry/voxel_grid.h"

namespace tileflight::ground_truth {

/// A sparse set of cells: bit sets of 8 x 8 x 8 cells ("bricks") in a hash table. Memory is proportional to the number
/// of bricks that hold a cell.
class BrickMap {
 public:
  /// Valid indices along each axis are 0 to 2^24 - 1.
  static constexpr std::int32_t kMaxCellsPerAxis = std::int32_t{1} << 24;

  /// 512 cells: plane[x], bit 8 y + z.
  struct Brick {
    std::array<std::uint64_t, 8> plane{};
  };

  BrickMap();

  void insert(std::int32_t x, std::int32_t y, std::int32_t z) {
    brick_at(x >> 3, y >> 3, z >> 3).plane[static_cast<std::size_t>(x & 7)] |= std::uint64_t{1}
                                                                               << ((y & 7) * 8 + (z & 7));
  }

  /// Inserts the cells from `cell` along `axis` up to index `last`.
  void insert_run(const std::array<std::int32_t, 3>& cell, std::size_t axis, std::int32_t last);

  /// Inserts all cells of another map.
  void merge(const BrickMap& other);

  /// Returns whether the cell is in the set; accepts any indices.
  bool contains(const geometry::Cell& cell) const {
    const Brick* brick = find(cell);
    return brick != nullptr && brick_contains(*brick, cell);
  }

  /// The brick that contains a cell, or nullptr; and whether a brick's cell is set.
  const Brick* find(const geometry::Cell& cell) const;
  static bool brick_contains(const Brick& brick, const geometry::Cell& cell) {
    return (brick.plane[static_cast<std::size_t>(cell.x & 7)] >> ((cell.y & 7) * 8 + (cell.z & 7)) & 1) != 0;
  }

  std::size_t brick_count() const { return bricks_.size(); }

  /// Returns all cells, sorted by x, then y, then z. Runs in parallel.
  std::vector<geometry::Cell> sorted_cells() const;

 private:
  static std::uint64_t brick_key(std::int32_t bx, std::int32_t by, std::int32_t bz) {
    return static_cast<std::uint64_t>(bx) << 42 | static_cast<std::uint64_t>(by) << 21 | static_cast<std::uint64_t>(bz);
  }

  Brick& brick_at(std::int32_t bx, std::int32_t by, std::int32_t bz) {
    const std::uint64_t key = brick_key(bx, by, bz);
    // Neighbouring triangles mostly lie in the same brick.
    if (key != last_key_) {
      last_brick_ = find_or_add(key);
      last_key_ = key;
    }
    return bricks_[last_brick_];
  }

  std::uint32_t find_or_add(std::uint64_t key);
  void grow();

  std::vector<std::uint32_t> slots_;  ///< hash table of brick index plus one; 0: free. Its size is a power of two
  std::vector<std::uint64_t> keys_;   ///< of each brick
  std::vector<Brick> bricks_;
  std::uint64_t last_key_ = ~std::uint64_t{0};
  std::uint32_t last_brick_ = 0;
};

}  // namespace tileflight::ground_truth
