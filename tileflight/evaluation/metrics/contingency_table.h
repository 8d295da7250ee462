#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <nlohmann/json_fwd.hpp>
#include <vector>

namespace tileflight::metrics {

/// 2x2 table of yes/no answers by the simulated and the real flight to the same questions, such as: was this frame
/// lost, was this place missed.
struct ContingencyTable {
  std::size_t both = 0, only_simulated = 0, only_real = 0, neither = 0;

  void add(bool simulated, bool real);
  std::size_t total() const { return both + only_simulated + only_real + neither; }
  /// Correlation of the two answers, -1 to 1 (Pearson; Yule 1912). NaN if one of them is constant.
  double phi() const;
};

/// Returns the 95 % interval of phi by bootstrap over blocks, since neighbouring answers are correlated. The tables of
/// the blocks are drawn with replacement, and quantiles are widened for few blocks. NaN for fewer than two blocks, or
/// if phi is undefined in some draws.
std::array<double, 2> phi_interval(const std::vector<ContingencyTable>& blocks, int resamples, std::uint64_t seed);

/// Returns {questions, both, only_simulated, only_real, neither, phi, predicted (share of real events that also
/// occurred in simulation), false_alarms (share of simulated events that did not occur in reality)}; the two shares are
/// null if there are no such events.
nlohmann::json to_json(const ContingencyTable& agreement);

}  // namespace tileflight::metrics
