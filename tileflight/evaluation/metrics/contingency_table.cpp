#include "tileflight/evaluation/metrics/contingency_table.h"

#include <algorithm>
#include <boost/math/special_functions/erf.hpp>
#include <cmath>
#include <nlohmann/json.hpp>
#include <numbers>

#include "tileflight/core/base/random_numbers.h"
#include "tileflight/evaluation/metrics/block_bootstrap.h"
#include "tileflight/evaluation/metrics/student_t.h"

namespace tileflight::metrics {

namespace {

ContingencyTable& operator+=(ContingencyTable& sum, const ContingencyTable& part) {
  sum.both += part.both;
  sum.only_simulated += part.only_simulated;
  sum.only_real += part.only_real;
  sum.neither += part.neither;
  return sum;
}

/// Tail probability on each side for 95 % coverage: the bootstrap's spread is too small by sqrt((n - 1) / n), and its
/// quantiles are the normal distribution's instead of Student's (Hesterberg, The American Statistician 69, 2015,
/// section 3.3).
double expanded_tail(std::size_t blocks) {
  const auto n = static_cast<double>(blocks);
  return 0.5 * boost::math::erfc(std::sqrt(n / (n - 1.0)) * student_t_quantile(0.975, n - 1.0) / std::numbers::sqrt2);
}

nlohmann::json share(std::size_t part, std::size_t whole) {
  return whole > 0 ? nlohmann::json(static_cast<double>(part) / static_cast<double>(whole)) : nlohmann::json(nullptr);
}

}  // namespace

void ContingencyTable::add(bool simulated, bool real) {
  std::size_t& cell = simulated ? (real ? both : only_simulated) : (real ? only_real : neither);
  ++cell;
}

double ContingencyTable::phi() const {
  const auto a = static_cast<double>(both), b = static_cast<double>(only_simulated), c = static_cast<double>(only_real),
             d = static_cast<double>(neither);
  const double margins = (a + b) * (c + d) * (a + c) * (b + d);
  return margins > 0.0 ? (a * d - b * c) / std::sqrt(margins) : std::nan("");
}

std::array<double, 2> phi_interval(const std::vector<ContingencyTable>& blocks, int resamples, std::uint64_t seed) {
  const std::array<double, 2> unknown{std::nan(""), std::nan("")};
  if (blocks.size() < 2) return unknown;
  base::SplitMix64 random(seed);
  std::vector<double> phis;
  for (int k = 0; k < resamples; ++k) {
    ContingencyTable total;
    for (std::size_t b = 0; b < blocks.size(); ++b) total += blocks[random.below(blocks.size())];
    if (std::isnan(total.phi())) return unknown;
    phis.push_back(total.phi());
  }
  std::sort(phis.begin(), phis.end());
  const double outside = expanded_tail(blocks.size());
  return {quantile(phis, outside), quantile(phis, 1.0 - outside)};
}

nlohmann::json to_json(const ContingencyTable& a) {
  return {{"questions", a.total()},
          {"both", a.both},
          {"only_simulated", a.only_simulated},
          {"only_real", a.only_real},
          {"neither", a.neither},
          {"phi", a.phi()},
          {"predicted", share(a.both, a.both + a.only_real)},
          {"false_alarms", share(a.only_simulated, a.both + a.only_simulated)}};
}

}  // namespace tileflight::metrics
