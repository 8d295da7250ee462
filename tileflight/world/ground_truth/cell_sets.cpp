#include "tileflight/world/ground_truth/cell_sets.h"

#include <algorithm>
#include <bit>
#include <cassert>

namespace tileflight::ground_truth {
namespace {

std::uint64_t number_of(const geometry::Cell& cell, const std::array<std::int32_t, 3>& dims) {
  const auto wide = [](std::int32_t value) { return static_cast<std::uint64_t>(value); };
  return (wide(cell.x) * wide(dims[1]) + wide(cell.y)) * wide(dims[2]) + wide(cell.z);
}

}  // namespace

/// A place in a set, from its first cell on.
class CellSets::Cursor {
 public:
  explicit Cursor(const std::vector<std::uint8_t>& steps) : next_(steps.data()), end_(steps.data() + steps.size()) {
    advance();
  }
  bool is_before(std::uint64_t end) const { return has_cell_ && number_ < end; }
  std::uint64_t number() const { return number_; }
  void advance() {
    has_cell_ = next_ != end_;
    if (!has_cell_) return;
    std::uint64_t step = 0;
    int shift = 0;
    for (; (*next_ & 0x80U) != 0; shift += 7) step |= static_cast<std::uint64_t>(*next_++ & 0x7FU) << shift;
    number_ += step | static_cast<std::uint64_t>(*next_++) << shift;
  }

 private:
  const std::uint8_t *next_, *end_;
  std::uint64_t number_ = 0;
  bool has_cell_ = false;
};

/// The cells of consecutive numbers that are in any of some sets.
class CellSets::Slab {
 public:
  static constexpr std::uint64_t kCells = std::uint64_t{1} << 22;

  /// Takes the cells from `begin` on, and leaves the cursors behind them.
  Slab(std::uint64_t begin, std::vector<Cursor>& sets) : words_(kCells / 64, 0) {
    for (Cursor& set : sets) {
      for (; set.is_before(begin + kCells); set.advance()) {
        const std::uint64_t bit = set.number() - begin;
        words_[bit / 64] |= std::uint64_t{1} << (bit % 64);
      }
    }
  }
  std::int64_t count_in(const Slab& other) const {
    std::int64_t count = 0;
    for (std::size_t i = 0; i < words_.size(); ++i) count += std::popcount(words_[i] & other.words_[i]);
    return count;
  }

 private:
  std::vector<std::uint64_t> words_;
};

void CellSets::set(std::size_t number, const geometry::VoxelGrid& grid) {
  assert(std::ranges::count(dims_, 0) == 3 || dims_ == grid.dims);
  dims_ = grid.dims;
  std::vector<std::uint8_t> steps;
  std::uint64_t before = 0;
  for (const geometry::Cell& cell : grid.occupied) {
    const std::uint64_t at = number_of(cell, dims_);
    std::uint64_t step = at - before;
    for (; step >= 0x80; step >>= 7) steps.push_back(static_cast<std::uint8_t>(0x80U | (step & 0x7FU)));
    steps.push_back(static_cast<std::uint8_t>(step));
    before = at;
  }
  steps.shrink_to_fit();
  bytes_ += steps.size() - steps_[number].size();
  steps_[number] = std::move(steps);
}

std::vector<std::int64_t> CellSets::count_covered(const Numbers& whole, std::span<const Numbers> parts) const {
  const auto cursors_of = [this](const Numbers& sets) {
    std::vector<Cursor> cursors;
    for (const std::uint32_t number : sets) cursors.emplace_back(steps_[number]);
    return cursors;
  };
  std::vector<Cursor> whole_cursors = cursors_of(whole);
  std::vector<std::vector<Cursor>> part_cursors;
  for (const Numbers& part : parts) part_cursors.push_back(cursors_of(part));
  std::vector<std::int64_t> counts(parts.size(), 0);
  const auto cells = static_cast<std::uint64_t>(dims_[0]) * static_cast<std::uint64_t>(dims_[1]) *
                     static_cast<std::uint64_t>(dims_[2]);
  for (std::uint64_t begin = 0; begin < cells; begin += Slab::kCells) {
    const Slab of_whole(begin, whole_cursors);
    for (std::size_t i = 0; i < parts.size(); ++i) counts[i] += Slab(begin, part_cursors[i]).count_in(of_whole);
  }
  return counts;
}

}  // namespace tileflight::ground_truth
