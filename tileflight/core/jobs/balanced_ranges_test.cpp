#include "tileflight/core/jobs/balanced_ranges.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <numeric>
#include <random>

namespace tileflight::jobs::balanced_ranges_test {
namespace {

TEST(BalancedRanges, AreAllWorksInOrderWithNoShareMuchTooLarge) {
  std::mt19937 random(5);
  for (int round = 0; round < 200; ++round) {
    std::vector<double> costs(random() % 30);
    for (double& cost : costs) cost = random() % 4 == 0 ? 0.0 : static_cast<double>(random() % 1000);
    const std::size_t count = 1 + random() % 9;
    const std::vector<IndexRange> ranges = balanced_ranges(costs, count);
    ASSERT_EQ(ranges.size(), count);
    const double total = std::accumulate(costs.begin(), costs.end(), 0.0);
    const double dearest = costs.empty() ? 0.0 : *std::max_element(costs.begin(), costs.end());
    std::size_t next = 0;
    for (const IndexRange& range : ranges) {
      EXPECT_EQ(range.begin, next);
      next = range.end;
      const double cost = std::accumulate(costs.begin() + static_cast<std::ptrdiff_t>(range.begin),
                                          costs.begin() + static_cast<std::ptrdiff_t>(range.end), 0.0);
      EXPECT_LE(cost, total / static_cast<double>(count) + dearest + 1e-6);
    }
    EXPECT_EQ(next, costs.size());
  }
}

TEST(BalancedRanges, CostCountsNotNumber) {
  EXPECT_EQ(balanced_ranges({1, 1, 1, 1, 4}, 2), (std::vector<IndexRange>{{0, 4}, {4, 5}}));
  EXPECT_EQ(balanced_ranges({0, 0, 0, 0}, 2), (std::vector<IndexRange>{{0, 2}, {2, 4}}));
  EXPECT_EQ(balanced_ranges({}, 2), (std::vector<IndexRange>{{0, 0}, {0, 0}}));
}

}  // namespace
}  // namespace tileflight::jobs::balanced_ranges_test
