#include "tileflight/evaluation/metrics/rank_correlation.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <numeric>
#include <random>

#include "tileflight/core/base/input_error.h"

namespace tileflight::metrics::rank_correlation_test {
namespace {

using Values = std::vector<double>;
using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

TEST(Kendall, ClosedForm) {
  EXPECT_DOUBLE_EQ(kendall_tau_b({1, 2, 3, 4}, {10, 20, 30, 40}), 1.0);
  EXPECT_DOUBLE_EQ(kendall_tau_b({1, 2, 3, 4}, {4, 3, 2, 1}), -1.0);
  EXPECT_DOUBLE_EQ(kendall_tau_b({1, 2, 3, 4}, {2, 1, 4, 3}), (4.0 - 2.0) / 6.0);
  // Kendall 1945: pairs tied in one list count in the other's pairs only. 8 of 10 pairs untied in a, 9 in b.
  EXPECT_NEAR(kendall_tau_b({1, 1, 2, 2, 3}, {1, 2, 3, 3, 4}), 8.0 / std::sqrt(8.0 * 9.0), 1e-15);
  EXPECT_TRUE(std::isnan(kendall_tau_b({1, 1, 1}, {1, 2, 3})));
  EXPECT_TRUE(std::isnan(kendall_tau_b({}, {})));
}

// The sum over all permutations has mean zero and the variance n(n-1)(2n+5)/18 (Kendall 1938).
TEST(Kendall, VarianceOverAllPermutations) {
  Values a{0, 1, 2, 3, 4, 5}, b = a;
  double sum = 0.0, squares = 0.0, n = 0.0;
  do {
    const double s = kendall_tau_b(a, b) * 15.0;
    sum += s;
    squares += s * s;
    ++n;
  } while (std::next_permutation(b.begin(), b.end()));
  EXPECT_NEAR(sum / n, 0.0, 1e-12);
  EXPECT_NEAR(squares / n, 6.0 * 5.0 * 17.0 / 18.0, 1e-9);
}

TEST(RankCorrelation, ExactPValues) {
  // Of the 24 orders of four items, the identical one and its reverse are equally extreme.
  EXPECT_NEAR(rank_correlation({1, 2, 3, 4}, {1, 2, 3, 4}).p_value, 2.0 / 24.0, 1e-15);
  EXPECT_TRUE(rank_correlation({1, 2, 3, 4}, {1, 2, 3, 4}).exact);
  // Printed tables of Kendall's test: n = 5, S = 8 is reached by 5 of 120 orders on each side.
  EXPECT_NEAR(rank_correlation({1, 2, 3, 4, 5}, {2, 1, 3, 4, 5}).p_value, 2.0 * 5.0 / 120.0, 1e-15);
}

TEST(RankCorrelation, RandomPermutationsAgreeWithTheNormalApproximation) {
  std::mt19937_64 random(1);
  Values a(30), b(30);
  std::iota(a.begin(), a.end(), 0.0);
  std::normal_distribution<double> noise(0.0, 20.0);
  for (std::size_t i = 0; i < a.size(); ++i) b[i] = a[i] + noise(random);
  const RankCorrelation found = rank_correlation(a, b);
  EXPECT_FALSE(found.exact);
  const double pairs = 30.0 * 29.0 / 2.0, sigma = std::sqrt(30.0 * 29.0 * 65.0 / 18.0);
  const double normal = std::erfc((std::abs(found.tau_b) * pairs - 1.0) / sigma / std::sqrt(2.0));
  EXPECT_NEAR(found.p_value, normal, 0.25 * normal + 0.001);
}

TEST(RankCorrelation, FewItemsHaveNoInterval) {
  EXPECT_EQ(rank_correlation({1, 2, 3}, {1, 2, 3}).interval.method, "none");
  EXPECT_TRUE(std::isnan(rank_correlation({1, 2, 3}, {1, 2, 3}).interval.ci95[0]));
  EXPECT_EQ(rank_correlation({1, 2, 3, 4, 5}, {1, 2, 3, 5, 4}).interval.method, "fieller");
  const RankCorrelation perfect = rank_correlation({1, 2, 3, 4, 5, 6, 7, 8}, {1, 2, 3, 4, 5, 6, 7, 8});
  EXPECT_EQ(perfect.interval.method, "fieller") << "all resamples agree, which is no certainty";
  EXPECT_EQ(perfect.interval.ci95[1], 1.0);
  EXPECT_LT(perfect.interval.ci95[0], 0.95);
  EXPECT_TRUE(std::isnan(rank_correlation({1, 1, 1, 1, 1}, {1, 2, 3, 4, 5}).p_value));
}

TEST(RankCorrelation, SameSeedSameIntervalAndOrderReversedIsNegated) {
  const Values a{3, 1, 4, 1.5, 9, 2.6, 5, 3.5, 8, 7}, b{2.7, 1, 8, 2, 8.1, 3, 4, 5, 9, 0};
  Values negated = b;
  for (double& v : negated) v = -v;
  EXPECT_EQ(to_json(rank_correlation(a, b)), to_json(rank_correlation(a, b)));
  const RankCorrelation one = rank_correlation(a, b), other = rank_correlation(a, negated);
  EXPECT_DOUBLE_EQ(one.tau_b, -other.tau_b);
  EXPECT_NEAR(one.interval.ci95[0], -other.interval.ci95[1], 1e-12);
  EXPECT_EQ(one.p_value, other.p_value);
}

TEST(RankCorrelation, RefusesBadInput) {
  EXPECT_THAT(
      [&] {
        rank_correlation({1, 2}, {1, 2, 3});
      },
      ThrowsMessage<InputError>(HasSubstr("the two lists must have the same items")));
  EXPECT_THAT(
      [&] {
        rank_correlation({1, 2, std::nan("")}, {1, 2, 3});
      },
      ThrowsMessage<InputError>(HasSubstr("a score is not a number")));
}

struct Population {
  std::size_t items;
  double correlation;
};

/// Of 1000 samples of a bivariate normal, whose tau is 2/pi asin(rho), the number of intervals that contain it.
int covered(const Population& population) {
  std::mt19937_64 random(7);
  std::normal_distribution<double> normal(0.0, 1.0);
  const double rho = population.correlation, truth = 2.0 / std::acos(-1.0) * std::asin(rho);
  int count = 0;
  for (std::uint64_t k = 0; k < 1000; ++k) {
    Values a, b;
    for (std::size_t i = 0; i < population.items; ++i) {
      a.push_back(normal(random));
      b.push_back(rho * a.back() + std::sqrt(1.0 - rho * rho) * normal(random));
    }
    const auto ci = tau_interval(a, b, 200, k).ci95;
    count += ci[0] <= truth && truth <= ci[1];
  }
  return count;
}

TEST(RankCorrelation, IntervalCoversTheTruthAsOftenAsItSays) {
  for (const Population& p : {Population{8, 0.7}, {12, 0.0}, {12, 0.7}, {20, 0.5}}) {
    const int held = covered(p);
    RecordProperty("covered", held);
    EXPECT_GE(held, 930) << p.items << " items, correlation " << p.correlation;
    EXPECT_LE(held, 975) << p.items << " items, correlation " << p.correlation;
  }
}

TEST(RankCorrelation, WithFewItemsTheIntervalCoversAtLeastAsOften) {
  for (const Population& p : {Population{5, 0.0}, {5, 0.9}, {6, 0.7}, {7, 0.5}, {7, 0.95}}) {
    EXPECT_GE(covered(p), 940) << p.items << " items, correlation " << p.correlation;
  }
}

}  // namespace
}  // namespace tileflight::metrics::rank_correlation_test
