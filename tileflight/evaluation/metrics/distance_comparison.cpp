#include <cmath>

#include "tileflight/core/base/input_error.h"
#include "tileflight/evaluation/metrics/block_bootstrap.h"
#include "tileflight/evaluation/metrics/metrics.h"
#include "tileflight/evaluation/metrics/repeated_runs.h"

namespace tileflight::metrics {

namespace {

void check(const KeptDistances& kept, const char* run) {
  if (kept.distances.empty())
    throw InputError(run, "no map point lies within the cut-off; there is nothing to compare");
  if (kept.positions.size() != kept.distances.size())
    throw InputError(run, "the number of positions differs from the number of distances");
}

void check(const DistanceComparisonOptions& options) {
  if (!(options.equivalence_margin_m > 0.0)) throw InputError("equivalence margin", "must be above zero, in metres");
  if (!(options.block_m > 0.0)) throw InputError("block of the bootstrap", "must be above zero, in metres");
  if (options.resamples < 100) throw InputError("resamples of the bootstrap", "must be at least 100");
}

std::string verdict_of(const std::array<double, 2>& ci90, const std::array<double, 2>& ci95, double margin_m) {
  if (ci90[0] >= -margin_m && ci90[1] <= margin_m) return "equivalent";
  if (ci95[0] > margin_m || ci95[1] < -margin_m) return "different";
  return "undecided";
}

/// Adds the interval and the verdict that follows from it.
void add_interval(const KeptDistances& simulated, const KeptDistances& real, const DistanceComparisonOptions& options,
                  DistanceComparison& result) {
  const std::vector<BlockSums> blocks = sum_by_block(simulated, real, options.block_m);
  result.blocks = blocks.size();
  result.verdict = "undecided";
  result.mean_difference_ci95.fill(std::numeric_limits<double>::quiet_NaN());
  if (blocks.size() < 2) return;
  const std::vector<double> differences = bootstrap_mean_differences(blocks, options.resamples, options.seed);
  if (differences.empty()) return;
  result.mean_difference_ci95 = {quantile(differences, 0.025), quantile(differences, 0.975)};
  const std::array<double, 2> ci90 = {quantile(differences, 0.05), quantile(differences, 0.95)};
  result.verdict = verdict_of(ci90, result.mean_difference_ci95, options.equivalence_margin_m);
  result.equivalent_within_m = std::max(std::abs(ci90[0]), std::abs(ci90[1]));
}

double share_kept(const KeptDistances& kept) {
  return static_cast<double>(kept.distances.size()) / static_cast<double>(kept.points);
}

std::vector<double> means_of(const std::vector<KeptDistances>& runs, const char* flight) {
  std::vector<double> means;
  for (const KeptDistances& run : runs) {
    check(run, flight);
    means.push_back(compute_statistics(run.distances).mean);
  }
  return means;
}

MeanDifference as_difference(const DistanceComparison& c) {
  return {c.mean_difference_m, c.mean_difference_ci95, c.verdict, c.equivalent_within_m};
}

}  // namespace

DistanceComparison compare_distances(const KeptDistances& simulated, const KeptDistances& real,
                                     const DistanceComparisonOptions& options) {
  check(simulated, "simulated run");
  check(real, "real run");
  check(options);
  const DistanceStatistics s = compute_statistics(simulated.distances), r = compute_statistics(real.distances);
  DistanceComparison result;
  result.mean_difference_m = s.mean - r.mean;
  result.std_difference_m = s.std - r.std;
  result.share_kept = {share_kept(simulated), share_kept(real)};
  result.points_ratio = static_cast<double>(simulated.points) / static_cast<double>(real.points);
  result.ks_statistic = ks_statistic(simulated.distances, real.distances);
  result.wasserstein_m = wasserstein_distance(simulated.distances, real.distances);
  result.equivalence_margin_m = options.equivalence_margin_m;
  add_interval(simulated, real, options, result);
  return result;
}

DistanceComparison compare_runs(const std::vector<KeptDistances>& simulated, const std::vector<KeptDistances>& real,
                                const DistanceComparisonOptions& options) {
  if (simulated.empty() || real.empty()) throw InputError("comparison", "needs at least one run of each flight");
  DistanceComparison result = compare_distances(simulated.front(), real.front(), options);
  result.runs = {simulated.size(), real.size()};
  const RunDifference by_run = welch_difference(means_of(simulated, "simulated run"), means_of(real, "real run"));
  if (!by_run.has_interval()) return result;
  result.within_run = as_difference(result);
  result.sampling_unit = "runs";
  result.mean_difference_m = by_run.difference;
  result.mean_difference_ci95 = by_run.ci95;
  result.verdict = verdict_of(by_run.ci90, by_run.ci95, options.equivalence_margin_m);
  result.equivalent_within_m = std::max(std::abs(by_run.ci90[0]), std::abs(by_run.ci90[1]));
  return result;
}

}  // namespace tileflight::metrics
