#include "tileflight/core/base/order_statistics.h"

#include <gtest/gtest.h>

#include <numeric>

#include "tileflight/core/base/random_numbers.h"

namespace tileflight::base::order_statistics_test {
namespace {

TEST(OrderStatistics, MediansAreThoseOfSortedValues) {
  SplitMix64 random(7);
  for (std::size_t n = 1; n < 40; ++n) {
    std::vector<double> values(n);
    for (double& v : values) v = static_cast<double>(random.below(9));  // many are equal
    std::vector<double> sorted = values;
    std::sort(sorted.begin(), sorted.end());
    EXPECT_EQ(upper_median(values), sorted[n / 2]);
    EXPECT_EQ(median(values), 0.5 * (sorted[(n - 1) / 2] + sorted[n / 2]));
    std::sort(values.begin(), values.end());
    EXPECT_EQ(values, sorted) << "the same values as before";
  }
}

}  // namespace
}  // namespace tileflight::base::order_statistics_test
