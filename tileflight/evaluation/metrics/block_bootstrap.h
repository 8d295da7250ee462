#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "tileflight/evaluation/metrics/metrics.h"

namespace tileflight::metrics {

/// Returns the Kolmogorov-Smirnov statistic of two samples: the largest difference of their empirical distribution
/// functions. Neither may be empty.
double ks_statistic(std::vector<double> a, std::vector<double> b);

/// Returns the 1-Wasserstein distance of two samples: the area between their empirical distribution functions, in the
/// samples' unit. Neither may be empty.
double wasserstein_distance(std::vector<double> a, std::vector<double> b);

/// Sums over one cube of space, for both runs.
struct BlockSums {
  std::array<double, 2> sum{};  ///< sum of the distances: simulated, real
  std::array<double, 2> count{};
};

/// Returns the sums over the cubes of edge `block_m` that contain a point of either run, in spatial order.
std::vector<BlockSums> sum_by_block(const KeptDistances& simulated, const KeptDistances& real, double block_m);

/// Returns the sorted differences of the two means (simulated minus real) over `resamples` draws of as many blocks as
/// there are, with replacement. Draws without a point of one of the runs are skipped. The draws depend only on the
/// seed, not on the number of threads.
std::vector<double> bootstrap_mean_differences(const std::vector<BlockSums>& blocks, int resamples, std::uint64_t seed);

/// Returns a quantile of sorted values, linearly interpolated (Hyndman and Fan's type 7). The list must not be empty.
double quantile(const std::vector<double>& sorted, double share);

}  // namespace tileflight::metrics
