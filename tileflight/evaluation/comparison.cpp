#include <cmath>

#include "tileflight/evaluation/block_bootstrap.h"
#include "tileflight/evaluation/metrics.h"
#include "tileflight/evaluation/two_samples.h"
#include "tileflight/geometry/input_error.h"

namespace tileflight::evaluation {

namespace {

void check(const KeptDistances& kept, const char* run) {
  if (kept.distances.empty()) throw InputError(run, "has no map point within the cut-off; there is nothing to compare");
  if (kept.positions.size() != kept.distances.size()) throw InputError(run, "has not one position for each distance");
}

void check(const ComparisonOptions& options) {
  if (!(options.equivalence_margin_m > 0.0)) throw InputError("equivalence margin", "must be above zero, in metres");
  if (!(options.block_m > 0.0)) throw InputError("block of the bootstrap", "must be above zero, in metres");
  if (options.resamples < 100) throw InputError("resamples of the bootstrap", "must be at least 100");
}

std::string verdict_of(const std::array<double, 2>& ci90, const std::array<double, 2>& ci95, double margin_m) {
  if (ci90[0] >= -margin_m && ci90[1] <= margin_m) return "equivalent";
  if (ci95[0] > margin_m || ci95[1] < -margin_m) return "different";
  return "undecided";
}

/// The interval and what follows from it.
void add_interval(const KeptDistances& simulated, const KeptDistances& real, const ComparisonOptions& options,
                  Comparison& result) {
  const std::vector<Block> blocks = blocks_of(simulated, real, options.block_m);
  result.blocks = blocks.size();
  result.verdict = "undecided";
  result.mean_difference_ci95.fill(std::numeric_limits<double>::quiet_NaN());
  if (blocks.size() < 2) return;
  const std::vector<double> differences = resampled_differences(blocks, options.resamples, options.seed);
  if (differences.empty()) return;
  result.mean_difference_ci95 = {quantile(differences, 0.025), quantile(differences, 0.975)};
  const std::array<double, 2> ci90 = {quantile(differences, 0.05), quantile(differences, 0.95)};
  result.verdict = verdict_of(ci90, result.mean_difference_ci95, options.equivalence_margin_m);
  result.equivalent_within_m = std::max(std::abs(ci90[0]), std::abs(ci90[1]));
}

}  // namespace

Comparison compare(const KeptDistances& simulated, const KeptDistances& real, const ComparisonOptions& options) {
  check(simulated, "simulated run");
  check(real, "real run");
  check(options);
  const DistanceStatistics s = statistics_of(simulated.distances), r = statistics_of(real.distances);
  Comparison result;
  result.mean_difference_m = s.mean - r.mean;
  result.std_difference_m = s.std - r.std;
  result.points_ratio = static_cast<double>(simulated.points) / static_cast<double>(real.points);
  result.ks_statistic = ks_statistic(simulated.distances, real.distances);
  result.wasserstein_m = wasserstein_distance(simulated.distances, real.distances);
  result.equivalence_margin_m = options.equivalence_margin_m;
  add_interval(simulated, real, options, result);
  return result;
}

}  // namespace tileflight::evaluation
