#pragma once

#include <array>
#include <limits>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

namespace tileflight::metrics {

/// Whether equivalence of two values is judged on their difference or on their ratio.
enum class MarginScale { kDifference, kRatio };

/// One metric of two maps, with 95 % intervals. Differences are simulated minus real, ratios simulated over real. NaN:
/// unknown (null in JSON).
struct ComparedMetric {
  static constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

  std::string name;  ///< part.key: "surface.median"
  double simulated = kNaN, real = kNaN;
  double difference = kNaN, ratio = kNaN;
  std::array<double, 2> difference_ci95{kNaN, kNaN}, ratio_ci95{kNaN, kNaN};

  MarginScale scale = MarginScale::kDifference;  ///< scale on which equivalence is judged
  /// Equivalence margin: largest difference, or largest ratio and its inverse.
  double margin = 0;
  double absolute_margin = 0;  ///< for a ratio: a difference up to this also counts as equivalent; 0: none
  bool is_decisive = true;     ///< whether the verdict on the maps depends on it

  /// p-value of being within the margin, two-sided as the interval; small if the values differ by more.
  double p_within = kNaN;
  /// p-value of being beyond the margin (two one-sided tests, Schuirmann 1987); small if the values are equivalent.
  double p_beyond = kNaN;
  std::string verdict = "undecided";     ///< "equivalent", "different" or "undecided"
  std::string sampling_unit = "blocks";  ///< sampling unit of the intervals: "blocks" of the place, "runs", or "one
                                         ///< path"
};

/// A value with its standard error and the degrees of freedom for Student's t.
struct Estimate {
  double value = ComparedMetric::kNaN, standard_error = ComparedMetric::kNaN, degrees_of_freedom = ComparedMetric::kNaN;

  std::array<double, 2> ci95() const;
  /// p-values of |true value| <= margin and of |true value| >= margin. NaN if the standard error is unknown.
  double p_within(double margin) const;
  double p_beyond(double margin) const;
};

/// Sets intervals, p-values and verdict of `measured` from its two values and from the estimates of their difference
/// and of the logarithm of their ratio.
void judge_equivalence(const Estimate& difference, const Estimate& log_ratio, ComparedMetric& measured);

/// Verdict over all decisive metrics. "different": at least one is beyond its margin, tested together at 5 % (Holm
/// 1979). "equivalent": each is within its margin at 5 % (Berger 1982: no correction is needed if all must hold). Else
/// "undecided".
struct Verdict {
  std::string word = "undecided";
  std::vector<std::string> decisive_metrics;  ///< names of the decisive metrics with known values
  std::vector<std::string> reasons;  ///< of those: the different ones; if undecided, the ones not shown equivalent
};
Verdict decide_verdict(std::vector<ComparedMetric>& measures);

/// Returns {simulated, real, difference, ci95, ratio, ratio_ci95, margin, margin_of ("difference" | "ratio"),
/// or_within, decides, p_within, p_beyond, unit, verdict}.
nlohmann::json to_json(const ComparedMetric& measured);

/// Compares the path errors (ATE, metres) of two flights tracked once each. A path is one sample: its error consists of
/// a few slow drifts, and its segments are not independent samples. If rotation, scale and position drift as random
/// walks, the squared error is distributed as a chi-square with at least two degrees of freedom (docs/trust.md), so
/// with two the intervals are never too narrow: the ratio's by Fisher's F(2, 2), the difference's from the intervals of
/// both errors (Zou and Donner, Statistics in Medicine 27, 2008). The margins in `measured` are used; the paths are
/// equivalent within the ratio or within `absolute_margin`.
void judge_single_paths(double simulated_m, double real_m, ComparedMetric& measured);

}  // namespace tileflight::metrics
