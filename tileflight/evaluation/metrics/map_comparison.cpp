#include "tileflight/evaluation/metrics/map_comparison.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <iterator>
#include <nlohmann/json.hpp>
#include <utility>

#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/warning.h"
#include "tileflight/evaluation/metrics/compared_metric.h"
#include "tileflight/evaluation/metrics/distances.h"
#include "tileflight/evaluation/metrics/repeated_runs.h"
#include "tileflight/evaluation/metrics/spatial_blocks.h"
#include "tileflight/evaluation/metrics/student_t.h"

namespace tileflight::metrics {

using nlohmann::json;

namespace {

constexpr double kNoValue = ComparedMetric::kNaN;
/// Smallest number of effective blocks; with fewer their variance is unreliable. Chosen by hand.
constexpr double kMinBlocks = 8.0;

/// "within_0.1".
std::string difference_key(const char* what, double threshold_m) {
  char text[32];
  const auto end = std::to_chars(text, text + sizeof text, threshold_m).ptr;
  return std::string(what) + "_" + std::string(text, end);
}

/// Definition of a metric: exact from all points of a map, and from sums over drawn blocks (`map`: 0 simulated, 1
/// real).
struct MetricDefinition {
  ComparedMetric measured;  ///< name, scale, margins
  std::function<double(const ScoredMap& map, const ScoredMap& other)> exact;
  std::function<double(const Eigen::RowVectorXd& sums, Eigen::Index map)> drawn;
  /// For metrics specific to this place: simulated minus real, in each block.
  std::function<Eigen::VectorXd(const Eigen::MatrixXd& blocks)> exchange_differences{};
};

double rms_within(const std::vector<double>& distances, double cutoff_m) {
  double squares = 0.0, kept = 0.0;
  for (const double d : distances) {
    if (!(d <= cutoff_m)) continue;
    squares += d * d;
    kept += 1.0;
  }
  return std::sqrt(squares / kept);
}

// ------------------------------------------------------------------------------------------------- sums over blocks

/// Columns of a block for the surface metrics, one set per map.
enum SurfaceColumn : Eigen::Index { kPoints, kWithin, kKept, kSquares, kFirstBin };
constexpr Eigen::Index kSurfaceColumns = kFirstBin + MedianBins::kBins;

Eigen::MatrixXd surface_sums(const std::array<const ScoredMap*, 2>& maps, const BlockAssignment& numbers,
                             const MedianBins& bins, const MapComparisonOptions& options) {
  Eigen::MatrixXd sums = Eigen::MatrixXd::Zero(static_cast<Eigen::Index>(numbers.block_of.size()), 2 * kSurfaceColumns);
  for (std::size_t map = 0; map < 2; ++map) {
    const Eigen::Index first = static_cast<Eigen::Index>(map) * kSurfaceColumns;
    const std::vector<double>& distances = maps[map]->surface.distances;
    for (std::size_t i = 0; i < distances.size(); ++i) {
      const Eigen::Index row = numbers.quarter_of[map][i];
      const double d = distances[i];
      sums(row, first + kPoints) += 1.0;
      sums(row, first + kFirstBin + bins.bin_of(d)) += 1.0;
      if (d <= options.accuracy_within_m) sums(row, first + kWithin) += 1.0;
      if (!(d <= options.cutoff_m)) continue;
      sums(row, first + kKept) += 1.0;
      sums(row, first + kSquares) += d * d;
    }
  }
  return sums;
}

std::vector<MetricDefinition> surface_numbers(const MedianBins& bins, const MapComparisonOptions& o) {
  const auto at = [](SurfaceColumn column) {
    return [column](const Eigen::RowVectorXd& s, Eigen::Index map) { return s[map * kSurfaceColumns + column]; };
  };
  const auto points = at(kPoints), within = at(kWithin), kept = at(kKept), squares = at(kSquares);
  const auto measured = [](std::string name, MarginScale scale, double margin) {
    return ComparedMetric{.name = "surface." + std::move(name), .scale = scale, .margin = margin};
  };
  return {{measured("median", MarginScale::kRatio, o.ratio_margin),
           [](const ScoredMap& m, const ScoredMap&) { return compute_statistics(m.surface.distances).median; },
           [=](const Eigen::RowVectorXd& s, Eigen::Index map) {
             return bins.median(s.segment(map * kSurfaceColumns + kFirstBin, MedianBins::kBins));
           }},
          {measured("rms", MarginScale::kRatio, o.ratio_margin),
           [=](const ScoredMap& m, const ScoredMap&) { return rms_within(m.surface.distances, o.cutoff_m); },
           [=](const Eigen::RowVectorXd& s, Eigen::Index map) { return std::sqrt(squares(s, map) / kept(s, map)); }},
          {measured(difference_key("within", o.accuracy_within_m), MarginScale::kDifference, o.share_margin),
           [=](const ScoredMap& m, const ScoredMap&) { return share_within(m.surface.distances, o.accuracy_within_m); },
           [=](const Eigen::RowVectorXd& s, Eigen::Index map) { return within(s, map) / points(s, map); }},
          {measured(difference_key("beyond", o.cutoff_m), MarginScale::kDifference, o.share_margin),
           [=](const ScoredMap& m, const ScoredMap&) { return 1.0 - share_within(m.surface.distances, o.cutoff_m); },
           [=](const Eigen::RowVectorXd& s, Eigen::Index map) { return 1.0 - kept(s, map) / points(s, map); }}};
}

/// Columns per map: number of samples, of those with a point within each threshold, of informative shared samples, and
/// of those that this map lacks.
struct SeenColumns {
  Eigen::Index thresholds = 0;

  Eigen::Index each() const { return 3 + thresholds; }
  Eigen::Index informative() const { return 1 + thresholds; }
  Eigen::Index lacking() const { return 2 + thresholds; }
};

Eigen::MatrixXd seen_sums(const std::array<const ScoredMap*, 2>& maps, const BlockAssignment& numbers,
                          const std::vector<double>& thresholds_m, const MissingParts& missing) {
  const SeenColumns columns{static_cast<Eigen::Index>(thresholds_m.size())};
  Eigen::MatrixXd sums = Eigen::MatrixXd::Zero(static_cast<Eigen::Index>(numbers.block_of.size()), 2 * columns.each());
  for (std::size_t map = 0; map < 2; ++map) {
    const Eigen::Index first = static_cast<Eigen::Index>(map) * columns.each();
    const std::vector<double>& distances = maps[map]->seen.map_distance_m;
    for (std::size_t i = 0; i < distances.size(); ++i) {
      const Eigen::Index row = numbers.quarter_of[map][i];
      sums(row, first) += 1.0;
      for (std::size_t t = 0; t < thresholds_m.size(); ++t) {
        if (distances[i] <= thresholds_m[t]) sums(row, first + 1 + static_cast<Eigen::Index>(t)) += 1.0;
      }
    }
    for (std::size_t k = 0; k < missing.shared_samples.size(); ++k) {
      const Eigen::Index row = numbers.quarter_of[0][missing.shared_samples[k].first];
      sums(row, first + columns.informative()) += missing.informative[k];
      sums(row, first + columns.lacking()) += missing.lacking[map][k];
    }
  }
  return sums;
}

MissingParts missing_of(const ScoredMap& map, const ScoredMap& other, const MapComparisonOptions& o) {
  return missing_parts(map.surface, map.seen, other.surface, other.seen, {.cutoff_m = o.cutoff_m});
}

std::vector<MetricDefinition> completeness_numbers(const MapComparisonOptions& o) {
  const SeenColumns columns{static_cast<Eigen::Index>(o.completeness_within_m.size())};
  std::vector<MetricDefinition> numbers;
  for (std::size_t t = 0; t < o.completeness_within_m.size(); ++t) {
    const double within_m = o.completeness_within_m[t];
    const auto column = static_cast<Eigen::Index>(1 + t);
    numbers.push_back(
        {{.name = "completeness." + difference_key("within", within_m),
          .scale = MarginScale::kRatio,
          .margin = o.completeness_margin,
          .is_decisive = t + 1 == o.completeness_within_m.size()},
         [=](const ScoredMap& m, const ScoredMap&) { return share_within(m.seen.map_distance_m, within_m); },
         [=](const Eigen::RowVectorXd& s, Eigen::Index map) {
           return s[map * columns.each() + column] / s[map * columns.each()];
         }});
  }
  return numbers;
}

/// `first`: missing parts of the first runs, which are needed most often.
MetricDefinition lacking_number(const MapComparisonOptions& o, const std::array<const ScoredMap*, 2>& maps,
                                const MissingParts& first) {
  const SeenColumns columns{static_cast<Eigen::Index>(o.completeness_within_m.size())};
  return {{.name = "completeness.lacking", .scale = MarginScale::kDifference, .margin = o.lacking_margin},
          [=, &first](const ScoredMap& m, const ScoredMap& other) {
            if (&m == maps[0] && &other == maps[1]) return first.lacking_share(0);
            if (&m == maps[1] && &other == maps[0]) return first.lacking_share(1);
            return missing_of(m, other, o).lacking_share(0);
          },
          [=](const Eigen::RowVectorXd& s, Eigen::Index map) {
            const Eigen::Index start = map * columns.each();
            return s[start + columns.lacking()] / s[start + columns.informative()];
          },
          [=](const Eigen::MatrixXd& blocks) -> Eigen::VectorXd {
            return blocks.col(columns.lacking()) - blocks.col(columns.each() + columns.lacking());
          }};
}

// --------------------------------------------------------------------------------------------------------- judging

ComparedMetric compare_by_blocks(const MetricDefinition& number, const std::array<const ScoredMap*, 2>& maps,
                                 const std::optional<BlockBootstrap>& bootstrap) {
  ComparedMetric m = number.measured;
  m.simulated = number.exact(*maps[0], *maps[1]);
  m.real = number.exact(*maps[1], *maps[0]);
  Estimate difference{.value = m.simulated - m.real}, log_ratio{.value = std::log(m.simulated / m.real)};
  if (bootstrap) {
    const auto& drawn = number.drawn;
    difference.standard_error =
        bootstrap->standard_error([&](const Eigen::RowVectorXd& s) { return drawn(s, 0) - drawn(s, 1); });
    log_ratio.standard_error =
        bootstrap->standard_error([&](const Eigen::RowVectorXd& s) { return std::log(drawn(s, 0) / drawn(s, 1)); });
    difference.degrees_of_freedom = log_ratio.degrees_of_freedom = bootstrap->degrees_of_freedom();
  }
  judge_equivalence(difference, log_ratio, m);
  if (bootstrap && number.exchange_differences && std::isfinite(m.difference))
    m.p_within = std::abs(m.difference) > m.margin ? bootstrap->exchange_p(number.exchange_differences) : 1.0;
  return m;
}

/// Welch's difference as an Estimate. If all runs are equal, the standard error is zero.
Estimate estimate_of(const RunDifference& d) {
  if (!d.has_interval()) return {d.difference, 0.0, 1.0};
  const double half = 0.5 * (d.ci95[1] - d.ci95[0]);
  return {d.difference, half / student_t_quantile(0.975, d.degrees_of_freedom), d.degrees_of_freedom};
}

std::vector<double> logarithms(std::vector<double> values) {
  for (double& v : values) v = std::log(v);
  return values;
}

/// `simulated`, `real`: value in each run.
ComparedMetric compare_by_runs(ComparedMetric m, const std::vector<double>& simulated,
                               const std::vector<double>& real) {
  const RunDifference difference = welch_difference(simulated, real),
                      log_ratio = welch_difference(logarithms(simulated), logarithms(real));
  m.simulated = difference.a.mean;
  m.real = difference.b.mean;
  m.sampling_unit = "runs";
  judge_equivalence(estimate_of(difference), estimate_of(log_ratio), m);
  return m;
}

/// Value in each run, against the first run of the other flight.
std::vector<double> values_by_run(const std::vector<ScoredMap>& runs, const std::vector<ScoredMap>& others,
                                  const std::function<double(const ScoredMap&, const ScoredMap&)>& exact) {
  std::vector<double> values;
  for (const ScoredMap& run : runs) values.push_back(exact(run, others.front()));
  return values;
}

bool runs_differ(const std::vector<ScoredMap>& simulated, const std::vector<ScoredMap>& real) {
  const auto rms = [](const ScoredMap& m, const ScoredMap&) { return compute_statistics(m.surface.distances).rmse; };
  return welch_difference(values_by_run(simulated, real, rms), values_by_run(real, simulated, rms)).has_interval();
}

/// Blocks of one part, and bootstrap draws if there are enough.
struct Part {
  std::optional<BlockSummary> used;
  std::optional<BlockBootstrap> bootstrap;
};

template <class Sums>
Part part_of(const std::vector<geometry::Vec3>& a, const std::vector<geometry::Vec3>& b,
             const MapComparisonOptions& options, const Sums& sums) {
  Part part;
  const std::optional<BlockGrid> blocks = choose_block_grid(a, b, options.min_effective_blocks);
  if (!blocks) return part;
  const BlockAssignment numbers = assign_blocks(*blocks, a, b);
  part.used = BlockSummary{blocks->edge_m, blocks->effective, numbers.blocks, numbers.exclusive};
  if (blocks->effective >= kMinBlocks)
    part.bootstrap.emplace(*blocks, numbers, sums(numbers), options.resamples, options.seed);
  return part;
}

/// The path metric, if both path errors are known.
std::optional<ComparedMetric> path_of(const std::vector<ScoredMap>& simulated, const std::vector<ScoredMap>& real,
                                      bool of_runs, const MapComparisonOptions& o) {
  ComparedMetric m{.name = "path.ate",
                   .scale = MarginScale::kRatio,
                   .margin = o.path_ratio_margin,
                   .absolute_margin = o.path_margin_m};
  const auto ate = [](const ScoredMap& map, const ScoredMap&) { return map.ate_rmse_m.value_or(kNoValue); };
  const std::vector<double> s = values_by_run(simulated, real, ate), r = values_by_run(real, simulated, ate);
  if (!std::isfinite(s.front()) || !std::isfinite(r.front())) return std::nullopt;
  if (of_runs) return compare_by_runs(m, s, r);
  judge_single_paths(s.front(), r.front(), m);
  return m;
}

void check(const std::vector<ScoredMap>& runs, const char* flight) {
  if (runs.empty()) throw InputError("comparison", "needs at least one run of each flight");
  for (const ScoredMap& run : runs) {
    if (run.surface.distances.empty()) throw InputError(flight, "no map point lies over the truth's surface");
    if (run.surface.positions.size() != run.surface.distances.size() ||
        run.seen.positions.size() != run.seen.map_distance_m.size())
      throw InputError(flight, "the number of positions differs from the number of distances");
  }
}

void check(const MapComparisonOptions& o) {
  if (!(std::min({o.ratio_margin, o.completeness_margin, o.path_ratio_margin}) > 1.0))
    throw InputError("margin of a ratio", "must be above one");
  if (!(std::min({o.share_margin, o.path_margin_m}) > 0.0)) throw InputError("margin", "must be above zero");
  if (o.resamples < 100) throw InputError("resamples of the bootstrap", "must be at least 100");
}

}  // namespace

MapComparison compare_maps(const std::vector<ScoredMap>& simulated, const std::vector<ScoredMap>& real,
                           const MapComparisonOptions& options) {
  check(simulated, "simulated flight");
  check(real, "real flight");
  check(options);
  const std::array<const ScoredMap*, 2> first{&simulated.front(), &real.front()};
  const bool of_runs = runs_differ(simulated, real);
  MapComparison result;
  const auto add = [&](const std::vector<MetricDefinition>& numbers, const Part& part) {
    for (const MetricDefinition& n : numbers)
      result.metrics.push_back(of_runs ? compare_by_runs(n.measured, values_by_run(simulated, real, n.exact),
                                                         values_by_run(real, simulated, n.exact))
                                       : compare_by_blocks(n, first, part.bootstrap));
  };

  const MedianBins bins(first[0]->surface.distances, first[1]->surface.distances);
  const Part surface =
      part_of(first[0]->surface.positions, first[1]->surface.positions, options,
              [&](const BlockAssignment& numbers) { return surface_sums(first, numbers, bins, options); });
  add(surface_numbers(bins, options), surface);
  result.surface_blocks = surface.used;

  if (!first[0]->seen.positions.empty() && !first[1]->seen.positions.empty()) {
    result.missing = missing_of(*first[0], *first[1], options);
    const Part seen =
        part_of(first[0]->seen.positions, first[1]->seen.positions, options, [&](const BlockAssignment& numbers) {
          return seen_sums(first, numbers, options.completeness_within_m, *result.missing);
        });
    std::vector<MetricDefinition> numbers = completeness_numbers(options);
    numbers.push_back(lacking_number(options, first, *result.missing));
    add(numbers, seen);
    result.completeness_blocks = seen.used;
  }
  if (const auto path = path_of(simulated, real, of_runs, options)) result.metrics.push_back(*path);
  result.verdict = decide_verdict(result.metrics);
  return result;
}

json to_json(const BlockSummary& b) {
  return {{"edge", b.edge_m},
          {"count", b.blocks},
          {"effective", b.effective},
          {"simulated_only", b.exclusive[0]},
          {"real_only", b.exclusive[1]}};
}

json to_json(const DistanceComparison& published, const std::optional<MapComparison>& maps, const Warnings& warnings) {
  json object = to_json(published);
  for (const char* part : {"surface", "completeness", "path", "missing_parts"}) object[part] = nullptr;
  const Verdict verdict = maps ? maps->verdict : Verdict{published.verdict, {"mean_difference"}, {}};
  object["verdict"] = verdict.word;
  object["verdict_on"] = verdict.decisive_metrics;
  object["verdict_because"] = verdict.reasons;
  Warnings forbidding;
  std::ranges::copy_if(warnings, std::back_inserter(forbidding), forbids_verdict);
  if (!forbidding.empty()) {
    object["verdict"] = kWithheld;
    object["verdict_without_warnings"] = verdict.word;
    object["verdict_withheld_by"] = to_json(forbidding);
  }
  if (!maps) return object;
  for (const ComparedMetric& m : maps->metrics) {
    const std::size_t dot = m.name.find('.');
    object[m.name.substr(0, dot)][m.name.substr(dot + 1)] = to_json(m);
  }
  if (maps->missing) object["missing_parts"] = to_json(*maps->missing);
  if (maps->surface_blocks) object["surface"]["blocks"] = to_json(*maps->surface_blocks);
  if (maps->completeness_blocks) object["completeness"]["blocks"] = to_json(*maps->completeness_blocks);
  return object;
}

}  // namespace tileflight::metrics
