#include "tileflight/evaluation/metrics/median_bins.h"

#include <gtest/gtest.h>

#include <random>

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
