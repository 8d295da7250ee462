#pragma once

#include <array>
#include <cstddef>
#include <limits>
#include <nlohmann/json.hpp>
#include <vector>

namespace tileflight::evaluation {

/// What a number came to over repeated runs.
struct RunSpread {
  std::size_t runs = 0;
  double mean = std::numeric_limits<double>::quiet_NaN();
  double std = std::numeric_limits<double>::quiet_NaN();  ///< divisor n - 1
  double smallest = std::numeric_limits<double>::quiet_NaN(), largest = std::numeric_limits<double>::quiet_NaN();
  /// Of the mean, by Student's t; NaN for fewer than two runs, and where all gave the same (they were not different
  /// runs).
  std::array<double, 2> ci95{std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::quiet_NaN()};
};

/// Values that are not finite (a run without that number) are left out.
RunSpread spread_of_runs(const std::vector<double>& values);

/// Difference of the means of two sets of runs, by Welch's t (Biometrika 34, 1947; degrees of freedom after
/// Satterthwaite 1946).
struct RunDifference {
  RunSpread a, b;
  double difference = std::numeric_limits<double>::quiet_NaN();  ///< a minus b
  double degrees_of_freedom = std::numeric_limits<double>::quiet_NaN();
  std::array<double, 2> ci95{std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::quiet_NaN()};
  std::array<double, 2> ci90{std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::quiet_NaN()};

  /// Whether both sides had two runs or more, and some of them differed.
  bool has_interval() const;
};

RunDifference difference_of_runs(const std::vector<double>& a, const std::vector<double>& b);

/// {n, mean, std, min, max, ci95}.
nlohmann::json to_json(const RunSpread& spread);

/// The spread of every number that repeated runs have in one place of their JSON objects: a tree like the first one's,
/// with the spread in each number's place. Lists and text are left out; a number that is null or missing in a run is
/// not counted in its `n`.
nlohmann::json spread_of_numbers(const std::vector<nlohmann::json>& objects);

}  // namespace tileflight::evaluation
