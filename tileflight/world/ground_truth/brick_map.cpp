#include "tileflight/world/ground_truth/brick_map.h"

#include <tbb/parallel_for.h>
#include <tbb/parallel_sort.h>

#include <algorithm>
#include <utility>

namespace tileflight::ground_truth {
namespace {

constexpr std::size_t kFirstSlots = 1024;
constexpr std::uint64_t kAxisMask = (std::uint64_t{1} << 21) - 1;

/// Fibonacci hashing (Knuth, The Art of Computer Programming 3, section 6.4): the upper bits of the product are well
/// mixed.
std::size_t slot_of(std::uint64_t key, std::size_t slots) {
  return static_cast<std::size_t>((key * 0x9E3779B97F4A7C15U) >> (64 - std::countr_zero(slots)));
}

std::int32_t axis_of(std::uint64_t key, int shift) { return static_cast<std::int32_t>(key >> shift & kAxisMask); }

using KeyedBrick = std::pair<std::uint64_t, const BrickMap::Brick*>;

/// A range of sorted bricks with the same x: [first, last).
struct Slab {
  std::size_t first, last;
  std::array<std::size_t, 8> plane_start{};  ///< output position of the cells of each x plane
};

std::vector<Slab> group_into_slabs(const std::vector<KeyedBrick>& bricks) {
  std::vector<Slab> slabs;
  for (std::size_t i = 0; i < bricks.size(); ++i) {
    if (i == 0 || bricks[i].first >> 42 != bricks[i - 1].first >> 42) slabs.push_back({i, i});
    slabs.back().last = i + 1;
  }
  return slabs;
}

/// Computes the start of every plane; returns the number of all cells.
std::size_t place_planes(const std::vector<KeyedBrick>& bricks, std::vector<Slab>& slabs) {
  std::size_t cells = 0;
  for (Slab& slab : slabs) {
    for (std::size_t x = 0; x < 8; ++x) {
      slab.plane_start[x] = cells;
      for (std::size_t i = slab.first; i < slab.last; ++i) {
        cells += static_cast<std::size_t>(std::popcount(bricks[i].second->plane[x]));
      }
    }
  }
  return cells;
}

/// Writes the cells of row (x, y) of one brick, which are eight bits along z.
geometry::Cell* write_row(unsigned row, std::int32_t x, std::int32_t y, std::int32_t z, geometry::Cell* out) {
  for (; row != 0; row &= row - 1) *out++ = {x, y, z + std::countr_zero(row)};
  return out;
}

/// Writes one x plane of a slab: rows of equal y run along z through all stacked bricks.
void write_plane(const std::vector<KeyedBrick>& bricks, const Slab& slab, std::size_t x, geometry::Cell* out) {
  const std::int32_t cell_x = axis_of(bricks[slab.first].first, 42) * 8 + static_cast<std::int32_t>(x);
  for (std::size_t i = slab.first; i < slab.last;) {
    std::size_t end = i;
    std::uint64_t rows = 0;  // mask of the eight rows of y that have cells
    for (; end < slab.last && bricks[end].first >> 21 == bricks[i].first >> 21; ++end)
      rows |= bricks[end].second->plane[x];
    const std::int32_t first_y = axis_of(bricks[i].first, 21) * 8;
    for (int y = 0; y < 8; ++y) {
      if ((rows >> (8 * y) & 0xff) == 0) continue;
      for (std::size_t k = i; k < end; ++k) {
        const auto row = static_cast<unsigned>(bricks[k].second->plane[x] >> (8 * y) & 0xff);
        out = write_row(row, cell_x, first_y + y, axis_of(bricks[k].first, 0) * 8, out);
      }
    }
    i = end;
  }
}

}  // namespace

BrickMap::BrickMap() : slots_(kFirstSlots, 0) {}

void BrickMap::insert_run(const std::array<std::int32_t, 3>& cell, std::size_t axis, std::int32_t last) {
  auto c = cell;
  for (; c[axis] <= last; ++c[axis]) insert(c[0], c[1], c[2]);
}

std::uint32_t BrickMap::find_or_add(std::uint64_t key) {
  std::size_t slot = slot_of(key, slots_.size());
  for (; slots_[slot] != 0; slot = (slot + 1) & (slots_.size() - 1)) {
    if (keys_[slots_[slot] - 1] == key) return slots_[slot] - 1;
  }
  const auto brick = static_cast<std::uint32_t>(bricks_.size());
  slots_[slot] = brick + 1;
  keys_.push_back(key);
  bricks_.emplace_back();
  if (2 * bricks_.size() > slots_.size()) grow();
  return brick;
}

const BrickMap::Brick* BrickMap::find(const geometry::Cell& cell) const {
  if (std::min({cell.x, cell.y, cell.z}) < 0 || std::max({cell.x, cell.y, cell.z}) >= kMaxCellsPerAxis) return nullptr;
  const std::uint64_t key = brick_key(cell.x >> 3, cell.y >> 3, cell.z >> 3);
  for (std::size_t slot = slot_of(key, slots_.size()); slots_[slot] != 0; slot = (slot + 1) & (slots_.size() - 1)) {
    if (keys_[slots_[slot] - 1] == key) return &bricks_[slots_[slot] - 1];
  }
  return nullptr;
}

void BrickMap::grow() {
  slots_.assign(2 * slots_.size(), 0);
  for (std::size_t i = 0; i < keys_.size(); ++i) {
    std::size_t slot = slot_of(keys_[i], slots_.size());
    while (slots_[slot] != 0) slot = (slot + 1) & (slots_.size() - 1);
    slots_[slot] = static_cast<std::uint32_t>(i + 1);
  }
}

void BrickMap::merge(const BrickMap& other) {
  for (std::size_t i = 0; i < other.bricks_.size(); ++i) {
    Brick& brick = bricks_[find_or_add(other.keys_[i])];
    for (std::size_t x = 0; x < 8; ++x) brick.plane[x] |= other.bricks_[i].plane[x];
  }
}

std::vector<geometry::Cell> BrickMap::sorted_cells() const {
  std::vector<KeyedBrick> bricks;
  bricks.reserve(bricks_.size());
  for (std::size_t i = 0; i < bricks_.size(); ++i) bricks.emplace_back(keys_[i], &bricks_[i]);
  tbb::parallel_sort(bricks.begin(), bricks.end());
  std::vector<Slab> slabs = group_into_slabs(bricks);
  std::vector<geometry::Cell> cells(place_planes(bricks, slabs));
  tbb::parallel_for(std::size_t{0}, slabs.size() * 8, [&](std::size_t i) {
    const Slab& slab = slabs[i / 8];
    write_plane(bricks, slab, i % 8, cells.data() + slab.plane_start[i % 8]);
  });
  return cells;
}

}  // namespace tileflight::ground_truth
