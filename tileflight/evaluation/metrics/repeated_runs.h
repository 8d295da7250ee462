#pragma once

#include <array>
#include <cstddef>
#include <limits>
#include <nlohmann/json_fwd.hpp>
#include <vector>

namespace tileflight::metrics {

/// Statistics of a number over repeated runs.
struct RunSpread {
  std::size_t runs = 0;
  double mean = std::numeric_limits<double>::quiet_NaN();
  double std = std::numeric_limits<double>::quiet_NaN();  ///< divisor n - 1
  double min = std::numeric_limits<double>::quiet_NaN(), max = std::numeric_limits<double>::quiet_NaN();
  /// Interval of the mean by Student's t; NaN for fewer than two runs, and if all values are equal (not independent
  /// runs).
  std::array<double, 2> ci95{std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::quiet_NaN()};
};

/// Computes the spread of finite values. Other values (a run without that number) are skipped.
RunSpread compute_run_spread(const std::vector<double>& values);

/// Difference of the means of two sets of runs, by Welch's t (Biometrika 34, 1947; degrees of freedom after
/// Satterthwaite 1946).
struct RunDifference {
  RunSpread a, b;
  double difference = std::numeric_limits<double>::quiet_NaN();  ///< a minus b
  double degrees_of_freedom = std::numeric_limits<double>::quiet_NaN();
  std::array<double, 2> ci95{std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::quiet_NaN()};
  std::array<double, 2> ci90{std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::quiet_NaN()};

  /// Whether both sides have at least two runs and some of them differ.
  bool has_interval() const;
};

RunDifference welch_difference(const std::vector<double>& a, const std::vector<double>& b);

/// Returns {n, mean, std, min, max, ci95}.
nlohmann::json to_json(const RunSpread& spread);

/// Computes the spread of every number in the JSON objects of repeated runs: an object with the structure of the first
/// one, with each number replaced by its spread. Lists and strings are omitted. A number that is null or missing in a
/// run is not counted in `n`.
nlohmann::json compute_json_spread(const std::vector<nlohmann::json>& objects);

}  // namespace tileflight::metrics
