#include "tileflight/evaluation/metrics/block_bootstrap.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cassert>
#include <cmath>
#include <limits>
#include <map>

#include "tileflight/core/base/random_numbers.h"

namespace tileflight::metrics {

namespace {

/// Calls `step(difference, length)` for every interval between neighbouring values of the two samples: difference of
/// the distribution functions on it, and its length.
template <class Step>
void walk_distributions(std::vector<double> a, std::vector<double> b, const Step& step) {
  assert(!a.empty() && !b.empty());
  std::sort(a.begin(), a.end());
  std::sort(b.begin(), b.end());
  std::size_t i = 0, j = 0;
  while (i < a.size() || j < b.size()) {
    const bool from_a = j == b.size() || (i < a.size() && a[i] <= b[j]);
    const double value = from_a ? a[i] : b[j];
    while (i < a.size() && a[i] == value) ++i;
    while (j < b.size() && b[j] == value) ++j;
    if (i == a.size() && j == b.size()) break;  // both functions are one from here on
    const double next = i == a.size() ? b[j] : j == b.size() ? a[i] : std::min(a[i], b[j]);
    const double share_a = static_cast<double>(i) / static_cast<double>(a.size());
    const double share_b = static_cast<double>(j) / static_cast<double>(b.size());
    step(std::abs(share_a - share_b), next - value);
  }
}

}  // namespace

double ks_statistic(std::vector<double> a, std::vector<double> b) {
  double largest = 0.0;
  walk_distributions(std::move(a), std::move(b),
                     [&](double difference, double) { largest = std::max(largest, difference); });
  return largest;
}

double wasserstein_distance(std::vector<double> a, std::vector<double> b) {
  double area = 0.0;
  walk_distributions(std::move(a), std::move(b),
                     [&](double difference, double length) { area += difference * length; });
  return area;
}

namespace {

using CellIndex = std::array<std::int64_t, 3>;

CellIndex cell_index(const geometry::Vec3& p, double block_m) {
  CellIndex place{};
  for (int axis = 0; axis < 3; ++axis)
    place[static_cast<std::size_t>(axis)] = static_cast<std::int64_t>(std::floor(p[axis] / block_m));
  return place;
}

double difference_of_means(const BlockSums& total) {
  if (total.count[0] == 0.0 || total.count[1] == 0.0) return std::numeric_limits<double>::quiet_NaN();
  return total.sum[0] / total.count[0] - total.sum[1] / total.count[1];
}

double one_resample(const std::vector<BlockSums>& blocks, std::uint64_t seed) {
  base::SplitMix64 random(seed);
  BlockSums total;
  for (std::size_t k = 0; k < blocks.size(); ++k) {
    const BlockSums& drawn = blocks[random.below(blocks.size())];
    for (std::size_t run = 0; run < 2; ++run) {
      total.sum[run] += drawn.sum[run];
      total.count[run] += drawn.count[run];
    }
  }
  return difference_of_means(total);
}

}  // namespace

std::vector<BlockSums> sum_by_block(const KeptDistances& simulated, const KeptDistances& real, double block_m) {
  std::map<CellIndex, BlockSums> by_place;
  std::size_t run = 0;
  for (const KeptDistances* kept : {&simulated, &real}) {
    for (std::size_t i = 0; i < kept->distances.size(); ++i) {
      BlockSums& block = by_place[cell_index(kept->positions[i], block_m)];
      block.sum[run] += kept->distances[i];
      block.count[run] += 1.0;
    }
    ++run;
  }
  std::vector<BlockSums> blocks;
  for (const auto& [place, block] : by_place) blocks.push_back(block);
  return blocks;
}

std::vector<double> bootstrap_mean_differences(const std::vector<BlockSums>& blocks, int resamples,
                                               std::uint64_t seed) {
  std::vector<double> differences(static_cast<std::size_t>(std::max(0, resamples)));
  base::SplitMix64 seeds(seed);
  std::vector<std::uint64_t> start(differences.size());
  for (std::uint64_t& s : start) s = seeds.next();
  tbb::parallel_for(std::size_t{0}, differences.size(),
                    [&](std::size_t k) { differences[k] = one_resample(blocks, start[k]); });
  std::erase_if(differences, [](double d) { return std::isnan(d); });
  std::sort(differences.begin(), differences.end());
  return differences;
}

double quantile(const std::vector<double>& sorted, double share) {
  assert(!sorted.empty());
  const double at = share * static_cast<double>(sorted.size() - 1);
  const auto below = static_cast<std::size_t>(at);
  const std::size_t above = std::min(below + 1, sorted.size() - 1);
  return sorted[below] + (at - static_cast<double>(below)) * (sorted[above] - sorted[below]);
}

}  // namespace tileflight::metrics
