#include "tileflight/world/ground_truth/cell_sets.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>
#include <set>
#include <tuple>

namespace tileflight::ground_truth::cell_sets_test {
namespace {

using geometry::Cell;
using geometry::VoxelGrid;
using CellKey = std::tuple<int, int, int>;

/// Random cells, near each other and far apart, of a grid that is larger than what is counted at once.
class CellSetsTest : public testing::Test {
 protected:
  static constexpr std::array<std::int32_t, 3> kDims{600, 300, 50};
  static constexpr std::uint32_t kSets = 12;

  CellSetsTest() {
    std::mt19937 random(3);
    for (std::uint32_t set = 0; set < kSets; ++set) {
      std::set<CellKey> cells;
      const int x0 = static_cast<int>(random() % 500), y0 = static_cast<int>(random() % 200);
      for (int k = 0; k < 4000; ++k) cells.emplace(x0 + random() % 60, y0 + random() % 60, 20 + random() % 8);
      for (int k = 0; k < 200; ++k) cells.emplace(random() % kDims[0], random() % kDims[1], random() % kDims[2]);
      if (set == 5) cells.clear();
      if (set == 6) cells = {{0, 0, 0}, {kDims[0] - 1, kDims[1] - 1, kDims[2] - 1}};
      VoxelGrid grid;
      grid.dims = kDims;
      for (const auto& [x, y, z] : cells) grid.occupied.push_back({x, y, z});
      sets_.set(set, grid);
      expected_.push_back(std::move(cells));
    }
  }
  std::set<CellKey> union_of(const CellSets::Numbers& numbers) const {
    std::set<CellKey> all;
    for (const std::uint32_t number : numbers) all.insert(expected_[number].begin(), expected_[number].end());
    return all;
  }

  CellSets sets_{kSets};
  std::vector<std::set<CellKey>> expected_;
};

TEST_F(CellSetsTest, CountWhatSetsOfTheStandardLibraryDo) {
  const std::vector<CellSets::Numbers> parts{
      {}, {0}, {5}, {6}, {1, 2, 3}, {2, 4, 6, 8, 10}, {0, 1, 2, 3, 4, 5, 6, 7, 8}};
  for (const CellSets::Numbers& whole : {CellSets::Numbers{0, 1, 2, 3, 4, 5, 6}, {7, 9, 11}, {}, {6}}) {
    const std::set<CellKey> cells = union_of(whole);
    const std::vector<std::int64_t> counts = sets_.count_covered(whole, parts);
    ASSERT_EQ(counts.size(), parts.size());
    for (std::size_t i = 0; i < parts.size(); ++i) {
      const std::set<CellKey> part = union_of(parts[i]);
      const auto expected = std::ranges::count_if(cells, [&](const CellKey& cell) { return part.contains(cell); });
      EXPECT_EQ(counts[i], expected) << i;
    }
  }
}

TEST_F(CellSetsTest, TakeLittleMemory) {
  std::size_t cells = 0;
  for (const auto& set : expected_) cells += set.size();
  EXPECT_LT(sets_.bytes(), 2 * cells);
  EXPECT_EQ(CellSets(3).bytes(), 0U);
  EXPECT_EQ(CellSets(3).count_covered({0, 1}, std::vector<CellSets::Numbers>{{2}}), std::vector<std::int64_t>{0});
}

}  // namespace
}  // namespace tileflight::ground_truth::cell_sets_test
