#pragma once

#include <array>
#include <limits>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

namespace tileflight::evaluation {

/// How two values of a number are judged to be the same.
enum class Scale { kDifference, kRatio };

/// A number of two maps side by side, with 95 % intervals. Differences are simulated minus real, ratios simulated over
/// real. NaN: not known (null in JSON).
struct Measured {
  static constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

  std::string name;  ///< part.key: "surface.median"
  double simulated = kNaN, real = kNaN;
  double difference = kNaN, ratio = kNaN;
  std::array<double, 2> difference_ci95{kNaN, kNaN}, ratio_ci95{kNaN, kNaN};

  Scale scale = Scale::kDifference;  ///< that it is judged on
  /// Up to this (as a difference, or as a ratio and its inverse) the two count as the same.
  double margin = 0;
  double or_within = 0;  ///< of a ratio: a difference up to this counts as the same, too; 0: none does
  bool decides = true;   ///< whether the verdict on the maps rests on it

  /// Of being within the margin, two-sided as the interval: small where the two are farther apart.
  double p_within = kNaN;
  /// Of being beyond the margin (two one-sided tests, Schuirmann 1987): small where they are the same.
  double p_beyond = kNaN;
  std::string verdict = "undecided";  ///< "equivalent", "different" or "undecided"
  std::string unit = "blocks";        ///< what the intervals are by: "blocks" of the place, "runs", or "one path"
};

/// A value, how far chance may have moved it, and for Student's t its degrees of freedom.
struct Estimate {
  double value = Measured::kNaN, standard_error = Measured::kNaN, degrees_of_freedom = Measured::kNaN;

  std::array<double, 2> ci95() const;
  /// Of |true value| <= margin, and of |true value| >= margin. NaN where the standard error is not known.
  double p_within(double margin) const;
  double p_beyond(double margin) const;
};

/// Fills in what follows from the simulated and the real value, and from the estimates of their difference and of the
/// logarithm of their ratio.
void judge(const Estimate& difference, const Estimate& log_ratio, Measured& measured);

/// The verdict on each, and on all together. "different": of those that decide at least one is beyond its margin,
/// tested together at 5 % (Holm 1979). "equivalent": each of them is within its margin at 5 % (Berger 1982: no
/// correction is needed where all must hold). Else "undecided".
struct Verdict {
  std::string word = "undecided";
  std::vector<std::string> on;       ///< names of those that decide and are known
  std::vector<std::string> because;  ///< of those: which differ; where it is undecided, which are not equivalent
};
Verdict verdict_on(std::vector<Measured>& measures);

/// {simulated, real, difference, ci95, ratio, ratio_ci95, margin, margin_of ("difference" | "ratio"), or_within,
/// decides, p_within, p_beyond, unit, verdict}.
nlohmann::json to_json(const Measured& measured);

}  // namespace tileflight::evaluation
