#include "tileflight/evaluation/metrics/spatial_blocks.h"

#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <cmath>
#include <map>
#include <random>

#include "tests/synthetic_maps.h"

namespace tileflight::metrics::spatial_blocks_test {
namespace {

using geometry::Vec3;

std::vector<Vec3> scattered(std::size_t n, double width_m, double length_m, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  std::uniform_real_distribution<double> east(-40.0, width_m - 40.0), north(10.0, length_m + 10.0), up(0.0, 30.0);
  std::vector<Vec3> points;
  for (std::size_t k = 0; k < n; ++k) points.push_back({east(random), north(random), up(random)});
  return points;
}

TEST(SpatialBlocks, AsLargeAsLeavesEnoughOfThem) {
  const auto a = scattered(5000, 200.0, 200.0, 1), b = scattered(3000, 200.0, 200.0, 2);
  const auto blocks = choose_block_grid(a, b, 30.0);
  ASSERT_TRUE(blocks);
  EXPECT_GE(blocks->effective, 30.0);
  EXPECT_LT(blocks->effective, 45.0);
  EXPECT_NEAR(blocks->edge_m, 200.0 / 6.0, 8.0);
  const auto corridor = choose_block_grid(scattered(5000, 2000.0, 20.0, 3), b, 30.0);
  EXPECT_LT(corridor->edge_m, 100.0) << "the one that has fewer decides";
}

TEST(SpatialBlocks, FewOutliersDoNotMakeThemLarge) {
  auto a = scattered(5000, 200.0, 200.0, 1);
  const auto b = scattered(3000, 200.0, 200.0, 2);
  const double edge_m = choose_block_grid(a, b, 30.0)->edge_m;
  a.push_back({1e7, 0, 0});
  EXPECT_NEAR(choose_block_grid(a, b, 30.0)->edge_m, edge_m, 0.2 * edge_m);
}

TEST(SpatialBlocks, WhereThereIsNothingToCut) {
  EXPECT_FALSE(choose_block_grid({}, {Vec3(0, 0, 0)}, 30.0));
  EXPECT_FALSE(choose_block_grid({Vec3(1, 2, 3), Vec3(1, 2, 9)}, {Vec3(1, 2, 3)}, 30.0));
  EXPECT_LT(choose_block_grid(scattered(6, 10, 10, 1), scattered(4, 10, 10, 2), 30.0)->effective, 5.0);
}

TEST(SpatialBlocks, EveryPointIsInTheQuarterAroundIt) {
  const auto a = scattered(500, 100.0, 60.0, 1), b = scattered(300, 40.0, 90.0, 2);
  const BlockGrid blocks{.east_m = -3.0, .north_m = 5.0, .edge_m = 20.0, .effective = 10.0};
  const BlockAssignment numbers = assign_blocks(blocks, a, b);
  std::map<std::pair<double, double>, std::uint32_t> quarter, block;
  std::map<std::uint32_t, int> reached;
  int set = 0;
  for (const auto* points : {&a, &b}) {
    const auto& list = numbers.quarter_of[static_cast<std::size_t>(set)];
    ASSERT_EQ(list.size(), points->size());
    for (std::size_t i = 0; i < list.size(); ++i) {
      const auto at = [&](double edge_m) {
        return std::pair(std::floor(((*points)[i].x() + 3.0) / edge_m), std::floor(((*points)[i].y() - 5.0) / edge_m));
      };
      EXPECT_EQ(quarter.try_emplace(at(10.0), list[i]).first->second, list[i]);
      EXPECT_EQ(block.try_emplace(at(20.0), numbers.block_of[list[i]]).first->second, numbers.block_of[list[i]]);
      reached[numbers.block_of[list[i]]] |= 1 << set;
    }
    ++set;
  }
  EXPECT_EQ(quarter.size(), numbers.block_of.size());
  EXPECT_EQ(block.size(), numbers.blocks);
  const auto alone = [&](int sets) {
    return static_cast<std::size_t>(
        std::count_if(reached.begin(), reached.end(), [&](auto& r) { return r.second == sets; }));
  };
  EXPECT_EQ(numbers.exclusive, (std::array{alone(1), alone(2)}));
  EXPECT_GT(numbers.exclusive[0], 0u);
}

/// Sums of a field over points, one column, and their count.
Eigen::MatrixXd field_sums(const BlockAssignment& numbers, const std::vector<Vec3>& points,
                           const tests::SmoothField& field) {
  Eigen::MatrixXd sums = Eigen::MatrixXd::Zero(static_cast<Eigen::Index>(numbers.block_of.size()), 2);
  for (std::size_t i = 0; i < points.size(); ++i) {
    sums(numbers.quarter_of[0][i], 0) += field.at({points[i].x(), points[i].y(), 0.0});
    sums(numbers.quarter_of[0][i], 1) += 1.0;
  }
  return sums;
}

/// Never below the spread by blocks or by quarter blocks, hence conservative: for independent neighbours the largest of
/// three estimates of the same variance exceeds it, by a sixth here.
TEST(SpatialBootstrap, StandardErrorIsTheSpreadOverOtherPlacesOrALittleMore) {
  const auto mean = [](const Eigen::RowVectorXd& s) { return s[0] / s[1]; };
  const auto points = scattered(4000, 200.0, 200.0, 5);
  const BlockGrid blocks = *choose_block_grid(points, points, 30.0);
  const BlockAssignment numbers = assign_blocks(blocks, points, points);
  for (const double correlation_m : {0.01, 4.0, 12.0}) {
    double squares = 0.0, said = 0.0;
    constexpr int kPlaces = 200;
    for (int k = 0; k < kPlaces; ++k) {
      const tests::SmoothField field(static_cast<std::uint64_t>(k), correlation_m);
      const BlockBootstrap bootstrap(blocks, numbers, field_sums(numbers, points, field), 200, 1);
      squares += std::pow(bootstrap.value(mean), 2);  // its true value is 0
      said += std::pow(bootstrap.standard_error(mean), 2);
    }
    EXPECT_GT(std::sqrt(said / squares), 0.85) << correlation_m;
    EXPECT_LT(std::sqrt(said / squares), 1.25) << correlation_m;
  }
}

TEST(SpatialBootstrap, ExchangedDifferencesAreAsOftenAsLargeAsOverAllSigns) {
  const auto points = scattered(4000, 100.0, 100.0, 7);
  const BlockGrid blocks{.east_m = -40.0, .north_m = 10.0, .edge_m = 30.0, .effective = 12.0};
  const BlockAssignment numbers = assign_blocks(blocks, points, points);
  ASSERT_EQ(numbers.blocks, 16u);
  for (const double shift : {0.0, 0.3, 1.0}) {
    Eigen::MatrixXd sums(static_cast<Eigen::Index>(numbers.block_of.size()), 1);
    std::vector<double> of_block(numbers.blocks, 0.0);
    for (std::size_t q = 0; q < numbers.block_of.size(); ++q) {
      sums(static_cast<Eigen::Index>(q), 0) = std::sin(3.0 * static_cast<double>(q * q)) + shift;
      of_block[numbers.block_of[q]] += sums(static_cast<Eigen::Index>(q), 0);
    }
    double whole = 0.0, as_far = 0.0;
    for (double& d : of_block) whole += d = std::copysign(std::sqrt(std::abs(d)), d);
    for (unsigned signs = 0; signs < 1U << 16; ++signs) {
      double sum = 0.0;
      for (std::size_t b = 0; b < 16; ++b) sum += (signs >> b & 1U) != 0 ? of_block[b] : -of_block[b];
      as_far += std::abs(sum) >= std::abs(whole) - 1e-9;
    }
    const BlockBootstrap bootstrap(blocks, numbers, sums, 4000, 3);
    const double p = bootstrap.exchange_p([](const Eigen::MatrixXd& s) -> Eigen::VectorXd { return s.col(0); });
    EXPECT_NEAR(p, as_far / 65536.0, 0.03) << shift;
  }
  const BlockBootstrap one(blocks, numbers,
                           Eigen::VectorXd::Unit(static_cast<Eigen::Index>(numbers.block_of.size()), 3), 500, 3);
  EXPECT_EQ(one.exchange_p([](const Eigen::MatrixXd& s) -> Eigen::VectorXd { return s.col(0); }), 1.0)
      << "one hole is the one's or the other's by chance";
}

TEST(SpatialBootstrap, SameForAnyNumberOfThreadsAndTheSeedDecides) {
  const auto mean = [](const Eigen::RowVectorXd& s) { return s[0] / s[1]; };
  const auto points = scattered(2000, 100.0, 100.0, 6);
  const BlockGrid blocks = *choose_block_grid(points, points, 30.0);
  const BlockAssignment numbers = assign_blocks(blocks, points, points);
  const Eigen::MatrixXd sums = field_sums(numbers, points, tests::SmoothField(1, 5.0));
  const auto error = [&](std::uint64_t seed) {
    return BlockBootstrap(blocks, numbers, sums, 300, seed).standard_error(mean);
  };
  const double first = error(1);
  {
    const tbb::global_control one(tbb::global_control::max_allowed_parallelism, 1);
    EXPECT_EQ(error(1), first);
  }
  EXPECT_NE(error(2), first);
  EXPECT_TRUE(std::isnan(BlockBootstrap(blocks, numbers, sums, 300, 1).standard_error([](const auto& s) {
    return std::log(-s[1]);
  }))) << "a number that is none in the draws";
}

}  // namespace
}  // namespace tileflight::metrics::spatial_blocks_test

namespace tileflight::metrics {
namespace {

std::vector<double> lognormal_distances(double middle_m, std::size_t count, unsigned seed) {
  std::mt19937 random(seed);
  std::lognormal_distribution<double> distance(std::log(middle_m), 0.8);
  std::vector<double> distances(count);
  for (double& d : distances) d = distance(random);
  return distances;
}

Eigen::RowVectorXd histogram(const MedianBins& bins, const std::vector<double>& distances) {
  Eigen::RowVectorXd counts = Eigen::RowVectorXd::Zero(MedianBins::kBins);
  for (const double d : distances) counts[bins.bin_of(d)] += 1.0;
  return counts;
}

TEST(MedianBins, AreAsGoodAsSortingToTheWidthOfABin) {
  for (unsigned seed = 1; seed <= 20; ++seed) {
    const std::vector<double> a = lognormal_distances(0.1, 2001, seed), b = lognormal_distances(0.7, 999, seed + 100);
    const MedianBins bins(a, b);
    for (std::vector<double> distances : {a, b}) {
      const double estimate = bins.median(histogram(bins, distances));
      std::ranges::nth_element(distances, distances.begin() + static_cast<std::ptrdiff_t>(distances.size() / 2));
      const double median = distances[distances.size() / 2];
      EXPECT_LE(std::abs(bins.bin_of(estimate) - bins.bin_of(median)), 1) << estimate << " for " << median;
      EXPECT_NEAR(estimate, median, 0.02 * median);
    }
  }
}

TEST(MedianBins, TakeAnyDistance) {
  const MedianBins bins({0.1, 0.2, 0.3}, {0.2, 0.4});
  EXPECT_EQ(bins.bin_of(0.0), 0);
  EXPECT_EQ(bins.bin_of(1e300), MedianBins::kBins - 1);
}

TEST(MedianBins, DistancesThatAreAllZeroHaveTheirMedianNearIt) {
  const std::vector<double> zeros(10, 0.0);
  const MedianBins bins(zeros, zeros);
  EXPECT_LT(bins.median(histogram(bins, zeros)), 1e-9);
}

}  // namespace
}  // namespace tileflight::metrics
