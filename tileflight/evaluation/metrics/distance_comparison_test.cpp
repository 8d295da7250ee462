#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <random>

#include "tileflight/core/base/input_error.h"
#include "tileflight/evaluation/metrics/block_bootstrap.h"
#include "tileflight/evaluation/metrics/map_comparison.h"
#include "tileflight/evaluation/metrics/metrics.h"
#include "tileflight/evaluation/metrics/repeated_runs.h"

namespace tileflight::metrics::distance_comparison_test {
namespace {

using geometry::Vec3;
using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

std::vector<double> uniform(std::size_t n, double from, double to, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  std::uniform_real_distribution<double> value(from, to);
  std::vector<double> values(n);
  for (double& v : values) v = value(random);
  return values;
}

double share_up_to(const std::vector<double>& values, double x) {
  return static_cast<double>(std::count_if(values.begin(), values.end(), [&](double v) { return v <= x; })) /
         static_cast<double>(values.size());
}

// ------------------------------------------------------------------------------------------------ two samples

TEST(KolmogorovSmirnov, ClosedForm) {
  EXPECT_DOUBLE_EQ(ks_statistic({1, 2, 3}, {1, 2, 3}), 0.0);
  EXPECT_DOUBLE_EQ(ks_statistic({1, 2}, {3, 4, 5}), 1.0);
  EXPECT_DOUBLE_EQ(ks_statistic({1, 2, 3, 4}, {3, 4, 5, 6}), 0.5);
  EXPECT_DOUBLE_EQ(ks_statistic({1, 1, 1, 2}, {1, 2, 2, 2}), 0.5) << "with ties";
}

TEST(KolmogorovSmirnov, BruteForce) {
  for (std::uint64_t seed = 1; seed < 20; ++seed) {
    auto a = uniform(37, 0, 1, seed), b = uniform(53, 0.1, 1.3, seed + 100);
    for (double& v : a) v = std::round(v * 20) / 20;  // ties within and between
    for (double& v : b) v = std::round(v * 20) / 20;
    double brute = 0.0;
    for (const auto* sample : {&a, &b}) {
      for (const double x : *sample) brute = std::max(brute, std::abs(share_up_to(a, x) - share_up_to(b, x)));
    }
    EXPECT_NEAR(ks_statistic(a, b), brute, 1e-12);
    EXPECT_DOUBLE_EQ(ks_statistic(b, a), ks_statistic(a, b));
  }
}

TEST(Wasserstein, ClosedForm) {
  EXPECT_DOUBLE_EQ(wasserstein_distance({0, 1, 3}, {5, 6, 8}), 5.0);
  EXPECT_DOUBLE_EQ(wasserstein_distance({1}, {1, 2}), 0.5);
  const auto a = uniform(1000, 0, 1, 3);
  auto shifted = a;
  for (double& v : shifted) v += 0.37;
  EXPECT_NEAR(wasserstein_distance(a, shifted), 0.37, 1e-12);
  EXPECT_DOUBLE_EQ(wasserstein_distance(a, a), 0.0);
}

TEST(Wasserstein, IsTheMeanDifferenceOfSortedPairs) {
  auto a = uniform(200, 0, 1, 4), b = uniform(200, 0.2, 0.7, 5);
  std::sort(a.begin(), a.end());
  std::sort(b.begin(), b.end());
  double sum = 0.0;
  for (std::size_t i = 0; i < a.size(); ++i) sum += std::abs(a[i] - b[i]);
  EXPECT_NEAR(wasserstein_distance(a, b), sum / 200.0, 1e-12);
}

TEST(Wasserstein, BruteForceForDifferentSizes) {
  const auto a = uniform(17, 0, 1, 6), b = uniform(31, 0, 2, 7);
  double area = 0.0;
  constexpr int kSteps = 400000;
  for (int k = 0; k < kSteps; ++k) {
    const double x = 2.0 * (k + 0.5) / kSteps;
    area += std::abs(share_up_to(a, x) - share_up_to(b, x)) * 2.0 / kSteps;
  }
  EXPECT_NEAR(wasserstein_distance(a, b), area, 1e-4);
}

TEST(Quantile, ClosedForm) {
  EXPECT_DOUBLE_EQ(quantile({1, 2, 3, 4, 5}, 0.5), 3.0);
  EXPECT_DOUBLE_EQ(quantile({1, 2, 3, 4}, 0.5), 2.5);
  EXPECT_DOUBLE_EQ(quantile({1, 2}, 0.0), 1.0);
  EXPECT_DOUBLE_EQ(quantile({1, 2}, 1.0), 2.0);
}

// ------------------------------------------------------------------------------------------------ bootstrap

/// One run over `blocks` cubes of 5 m in a row: each cube has an error of its own (its spread) that all of its points
/// share, and each point another.
KeptDistances run_over(int blocks, int points_each, double mean_m, double block_spread_m, double point_spread_m,
                       std::mt19937_64& random) {
  std::normal_distribution<double> normal(0.0, 1.0);
  KeptDistances kept;
  for (int b = 0; b < blocks; ++b) {
    const double of_block = mean_m + block_spread_m * normal(random);
    for (int k = 0; k < points_each; ++k) {
      kept.positions.push_back({5.0 * b + 2.5, 1.0, 1.0});
      kept.distances.push_back(of_block + point_spread_m * normal(random));
    }
  }
  kept.points = 2 * kept.distances.size();
  return kept;
}

TEST(BlockBootstrap, BlocksHoldEveryPointOnce) {
  std::mt19937_64 random(1);
  const auto a = run_over(7, 11, 0.5, 0.1, 0.1, random), b = run_over(9, 4, 0.5, 0.1, 0.1, random);
  const auto blocks = sum_by_block(a, b, 5.0);
  ASSERT_EQ(blocks.size(), 9u);
  double count_a = 0.0, sum_b = 0.0;
  for (const BlockSums& block : blocks) {
    count_a += block.count[0];
    sum_b += block.sum[1];
  }
  EXPECT_EQ(count_a, 77.0);
  EXPECT_NEAR(sum_b, compute_statistics(b.distances).mean * 36.0, 1e-9);
  EXPECT_EQ(sum_by_block(a, b, 1000.0).size(), 1u);
}

TEST(BlockBootstrap, SpreadOfIndependentPointsIsTheTextbooks) {
  std::mt19937_64 random(2);
  const auto a = run_over(400, 1, 0.5, 0.0, 0.2, random), b = run_over(400, 1, 0.5, 0.0, 0.3, random);
  const auto differences = bootstrap_mean_differences(sum_by_block(a, b, 5.0), 4000, 3);
  const auto sa = compute_statistics(a.distances), sb = compute_statistics(b.distances);
  const double expected = std::sqrt((sa.std * sa.std + sb.std * sb.std) / 400.0);
  EXPECT_NEAR(compute_statistics(differences).std, expected, 0.08 * expected);
  EXPECT_NEAR(compute_statistics(differences).mean, sa.mean - sb.mean, 4.0 * expected / std::sqrt(4000.0));
}

TEST(BlockBootstrap, ErrorsThatNeighboursShareWidenTheInterval) {
  std::mt19937_64 random(3);
  const auto a = run_over(60, 50, 0.5, 0.1, 0.05, random), b = run_over(60, 50, 0.5, 0.1, 0.05, random);
  const auto by_block = compare_distances(a, b, {.block_m = 5.0});
  auto scattered_a = a, scattered_b = b;  // as if all points were independent
  for (auto* kept : {&scattered_a, &scattered_b}) {
    for (std::size_t i = 0; i < kept->positions.size(); ++i) kept->positions[i].y() = 5.0 * static_cast<double>(i);
  }
  const auto by_point = compare_distances(scattered_a, scattered_b, {.block_m = 5.0});
  const auto width = [](const DistanceComparison& c) { return c.mean_difference_ci95[1] - c.mean_difference_ci95[0]; };
  EXPECT_GT(width(by_block), 4.0 * width(by_point));
}

TEST(BlockBootstrap, IntervalCoversTheTruthAsOftenAsItSays) {
  std::mt19937_64 random(4);
  int covered = 0;
  constexpr int kExperiments = 1000;
  for (int k = 0; k < kExperiments; ++k) {
    const auto a = run_over(80, 4, 0.55, 0.1, 0.1, random), b = run_over(80, 3, 0.52, 0.08, 0.1, random);
    const auto c = compare_distances(a, b, {.resamples = 400, .seed = static_cast<std::uint64_t>(k)});
    covered += c.mean_difference_ci95[0] <= 0.03 && 0.03 <= c.mean_difference_ci95[1];
  }
  EXPECT_GE(covered, 930);
  EXPECT_LE(covered, 970);
}

TEST(BlockBootstrap, PermutationTestAgrees) {
  // Under the hypothesis of no difference, exchanging the two runs block by block gives the same spread as the
  // bootstrap.
  std::mt19937_64 random(5);
  const auto a = run_over(100, 5, 0.5, 0.1, 0.1, random), b = run_over(100, 5, 0.5, 0.1, 0.1, random);
  const auto blocks = sum_by_block(a, b, 5.0);
  std::vector<double> exchanged;
  for (int k = 0; k < 4000; ++k) {
    BlockSums total;
    for (const BlockSums& block : blocks) {
      const std::size_t swap = random() & 1u;
      for (std::size_t run = 0; run < 2; ++run) {
        total.sum[run ^ swap] += block.sum[run];
        total.count[run ^ swap] += block.count[run];
      }
    }
    exchanged.push_back(total.sum[0] / total.count[0] - total.sum[1] / total.count[1]);
  }
  const double by_permutation = compute_statistics(exchanged).std;
  EXPECT_NEAR(compute_statistics(bootstrap_mean_differences(blocks, 4000, 6)).std, by_permutation,
              0.12 * by_permutation);
}

// ------------------------------------------------------------------------------------------------ comparison

TEST(Comparison, NumbersOfTheTwoRuns) {
  KeptDistances a{{{0, 0, 0}, {10, 0, 0}, {20, 0, 0}}, {0.2, 0.4, 0.6}, 12}, b{{{0, 0, 0}, {10, 0, 0}}, {0.1, 0.5}, 8};
  const auto c = compare_distances(a, b);
  EXPECT_NEAR(c.mean_difference_m, 0.1, 1e-12);
  EXPECT_NEAR(c.std_difference_m, 0.2 - std::sqrt(0.08), 1e-12);
  EXPECT_DOUBLE_EQ(c.points_ratio, 1.5);
  EXPECT_DOUBLE_EQ(c.ks_statistic, 0.5);
  EXPECT_EQ(c.blocks, 3u);
}

TEST(Comparison, VerdictsFollowTheInterval) {
  std::mt19937_64 random(6);
  const auto a = run_over(400, 10, 0.55, 0.05, 0.15, random), same = run_over(400, 10, 0.56, 0.05, 0.15, random);
  const auto worse = run_over(400, 10, 0.75, 0.05, 0.15, random), few = run_over(6, 10, 0.57, 0.15, 0.15, random);
  const auto equal = compare_distances(a, same);
  EXPECT_EQ(equal.verdict, "equivalent");
  EXPECT_LT(*equal.equivalent_within_m, 0.05);
  EXPECT_GE(*equal.equivalent_within_m, std::abs(equal.mean_difference_m));
  EXPECT_EQ(compare_distances(a, same, {.equivalence_margin_m = 1e-4}).verdict == "equivalent", false);
  const auto different = compare_distances(a, worse);
  EXPECT_EQ(different.verdict, "different");
  EXPECT_LT(different.mean_difference_ci95[1], -0.05);
  EXPECT_EQ(compare_distances(few, few, {.equivalence_margin_m = 1e-9}).verdict, "equivalent")
      << "the same run twice, block for block";
  KeptDistances apart = few;
  for (auto& p : apart.positions) p.y() += 1000.0;
  EXPECT_EQ(compare_distances(few, apart).verdict, "undecided");
}

TEST(Comparison, OneBlockDecidesNothing) {
  KeptDistances a{{{0, 0, 0}, {1, 0, 0}}, {0.2, 0.4}, 2};
  const auto c = compare_distances(a, a);
  EXPECT_EQ(c.verdict, "undecided");
  EXPECT_TRUE(std::isnan(c.mean_difference_ci95[0]));
  EXPECT_FALSE(c.equivalent_within_m);
  EXPECT_NE(to_json(c).dump().find("\"mean_difference_ci95\":[null,null]"), std::string::npos);
}

TEST(Comparison, RepeatedRunsAreTheUnit) {
  std::mt19937_64 random(11);
  std::vector<KeptDistances> simulated, real;
  std::vector<double> simulated_means, real_means;
  for (const double shift : {0.0, 0.004, -0.002, 0.001}) {
    simulated.push_back(run_over(50, 10, 0.55 + shift, 0.02, 0.05, random));
    simulated_means.push_back(compute_statistics(simulated.back().distances).mean);
  }
  for (const double shift : {0.01, -0.01, 0.0}) {
    real.push_back(run_over(50, 10, 0.52 + shift, 0.02, 0.05, random));
    real_means.push_back(compute_statistics(real.back().distances).mean);
  }
  const auto first_only = compare_distances(simulated[0], real[0]), by_run = compare_runs(simulated, real);
  const RunDifference expected = welch_difference(simulated_means, real_means);
  EXPECT_EQ(by_run.sampling_unit, "runs");
  EXPECT_EQ(by_run.runs, (std::array<std::size_t, 2>{4, 3}));
  EXPECT_DOUBLE_EQ(by_run.mean_difference_m, expected.difference);
  EXPECT_EQ(by_run.mean_difference_ci95, expected.ci95);
  EXPECT_DOUBLE_EQ(*by_run.equivalent_within_m, std::max(std::abs(expected.ci90[0]), std::abs(expected.ci90[1])));
  ASSERT_TRUE(by_run.within_run);
  EXPECT_EQ(by_run.within_run->difference_m, first_only.mean_difference_m);
  EXPECT_EQ(by_run.within_run->ci95, first_only.mean_difference_ci95);
  EXPECT_EQ(by_run.within_run->verdict, first_only.verdict);
  EXPECT_EQ(by_run.ks_statistic, first_only.ks_statistic);
}

TEST(Comparison, RunsThatDoNotDifferAreNoUnit) {
  std::mt19937_64 random(12);
  const auto a = run_over(50, 10, 0.5, 0.1, 0.1, random), b = run_over(50, 10, 0.6, 0.1, 0.1, random);
  auto expected = to_json(compare_distances(a, b));
  EXPECT_EQ(to_json(compare_runs({a}, {b})), expected) << "one run each: as before";
  const auto same = to_json(compare_runs({a, a, a}, {b, b}));
  EXPECT_EQ(same["runs"]["simulated"], 3);
  expected["runs"] = same["runs"];
  EXPECT_EQ(same, expected);
  EXPECT_THAT([&] { compare_runs({}, {b}); },
              ThrowsMessage<InputError>(HasSubstr("needs at least one run of each flight")));
  EXPECT_THAT(
      [&] {
        compare_runs({a, {}}, {b, b});
      },
      ThrowsMessage<InputError>(HasSubstr("simulated run: no map point lies within the cut-off")));
}

TEST(Comparison, ExchangedRunsTurnTheSign) {
  std::mt19937_64 random(7);
  const auto a = run_over(50, 10, 0.5, 0.1, 0.1, random), b = run_over(50, 10, 0.6, 0.1, 0.1, random);
  const auto forward = compare_distances(a, b), backward = compare_distances(b, a);
  EXPECT_DOUBLE_EQ(forward.mean_difference_m, -backward.mean_difference_m);
  EXPECT_NEAR(forward.mean_difference_ci95[0], -backward.mean_difference_ci95[1], 1e-12);
}

TEST(Comparison, SameBitsForAnyNumberOfThreadsAndSeedMatters) {
  std::mt19937_64 random(8);
  const auto a = run_over(50, 10, 0.5, 0.1, 0.1, random), b = run_over(50, 10, 0.6, 0.1, 0.1, random);
  std::vector<std::string> results;
  for (const std::size_t threads : {1u, 2u, 5u}) {
    const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
    results.push_back(to_json(compare_distances(a, b)).dump());
  }
  EXPECT_EQ(results[0], results[1]);
  EXPECT_EQ(results[0], results[2]);
  EXPECT_NE(to_json(compare_distances(a, b, {.seed = 2})).dump(), results[0]);
}

TEST(Comparison, KeysOfTheContract) {
  std::mt19937_64 random(9);
  const auto a = run_over(50, 10, 0.5, 0.1, 0.1, random);
  const auto json = to_json(compare_distances(a, a), std::nullopt);
  for (const char* key : {"mean_difference", "std_difference", "points_ratio", "ks_statistic", "wasserstein_m",
                          "mean_difference_ci95", "equivalent_within_m", "verdict"}) {
    EXPECT_TRUE(json.contains(key)) << key;
  }
}

TEST(Comparison, RefusesBadInput) {
  std::mt19937_64 random(10);
  const auto a = run_over(5, 5, 0.5, 0.1, 0.1, random);
  EXPECT_THAT([&] { compare_distances({}, a); },
              ThrowsMessage<InputError>(HasSubstr("simulated run: no map point lies within the cut-off")));
  EXPECT_THAT([&] { compare_distances(a, {}); },
              ThrowsMessage<InputError>(HasSubstr("real run: no map point lies within the cut-off")));
  EXPECT_THAT(
      [&] {
        compare_distances({{}, {0.1}, 1}, a);
      },
      ThrowsMessage<InputError>(HasSubstr("the number of positions differs from the number of distances")));
  EXPECT_THAT([&] { compare_distances(a, a, {.equivalence_margin_m = 0.0}); },
              ThrowsMessage<InputError>(HasSubstr("equivalence margin: must be above zero")));
  EXPECT_THAT([&] { compare_distances(a, a, {.block_m = -1.0}); },
              ThrowsMessage<InputError>(HasSubstr("block of the bootstrap: must be above zero")));
  EXPECT_THAT([&] { compare_distances(a, a, {.resamples = 1}); },
              ThrowsMessage<InputError>(HasSubstr("resamples of the bootstrap: must be at least 100")));
}

}  // namespace
}  // namespace tileflight::metrics::distance_comparison_test
