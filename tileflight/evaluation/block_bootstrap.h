#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "tileflight/evaluation/metrics.h"

namespace tileflight::evaluation {

/// Sums of one cube of space, of both runs.
struct Block {
  std::array<double, 2> sum{};  ///< of the distances: simulated, real
  std::array<double, 2> count{};
};

/// Cubes of edge `block_m` that hold a point of either run, in order of their place.
std::vector<Block> blocks_of(const KeptDistances& simulated, const KeptDistances& real, double block_m);

/// Differences of the two means (simulated minus real) over `resamples` draws of as many blocks as there are, with
/// replacement; sorted. Draws without a point of one of the runs are left out. The same seed gives the same draws with
/// any number of threads.
std::vector<double> resampled_differences(const std::vector<Block>& blocks, int resamples, std::uint64_t seed);

/// Quantile of sorted values, linear between them (Hyndman and Fan's type 7). Not for an empty list.
double quantile(const std::vector<double>& sorted, double share);

}  // namespace tileflight::evaluation
