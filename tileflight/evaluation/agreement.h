#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <nlohmann/json.hpp>
#include <vector>

namespace tileflight::evaluation {

/// Two yes-or-no answers to the same questions: was this frame lost, was this place missed; by the simulated flight and
/// by the real one.
struct Agreement {
  std::size_t both = 0, only_simulated = 0, only_real = 0, neither = 0;

  void add(bool simulated, bool real);
  std::size_t questions() const { return both + only_simulated + only_real + neither; }
  /// The correlation of the two answers, -1 to 1 (Pearson; Yule 1912). NaN where one of them is always the same.
  double phi() const;
};

/// 95 % interval of phi by bootstrap over blocks, since neighbouring answers hang together: the table of each block,
/// drawn with replacement; quantiles widened for few blocks. NaN for fewer than two blocks, or where phi is none in
/// some draws.
std::array<double, 2> phi_interval(const std::vector<Agreement>& blocks, int resamples, std::uint64_t seed);

/// {questions, both, only_simulated, only_real, neither, phi, predicted (of what happened in reality the share that
/// simulation had too), false_alarms (of what happened in simulation the share that reality had not)}; null where there
/// is nothing to take a share of.
nlohmann::json to_json(const Agreement& agreement);

}  // namespace tileflight::evaluation
