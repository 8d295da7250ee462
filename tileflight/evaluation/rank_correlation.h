#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

namespace tileflight::evaluation {

/// Kendall's tau-b (Biometrika 33, 1945): how far two lists of values put the same items into the same order, 1 to -1,
/// corrected for ties. NaN where one of the lists has no two different values.
double kendall_tau_b(const std::vector<double>& a, const std::vector<double>& b);

/// 95 % interval of tau-b, where the items are a sample of such items.
struct TauInterval {
  std::array<double, 2> ci95{std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::quiet_NaN()};
  std::string method = "none";  ///< or "bootstrap", "fieller"
};

/// From 8 items on the percentile bootstrap's over items; from 5 to 7 (too few for a bootstrap), and where all
/// resamples agree, that of Fieller, Hartley and Pearson (Biometrika 44, 1957: Fisher's z of tau with variance 0.437 /
/// (n - 4)), widened by one discordant pair, since tau takes few values there: it covers more often than it says. None
/// below 5.
TauInterval tau_interval(const std::vector<double>& a, const std::vector<double>& b, int resamples, std::uint64_t seed);

struct RankCorrelation {
  std::size_t items = 0;
  double tau_b = std::numeric_limits<double>::quiet_NaN();
  TauInterval interval;
  double p_value = std::numeric_limits<double>::quiet_NaN();  ///< two-sided, of no relation between the two orders
  bool exact = false;                                         ///< by all permutations, not by random ones
};

/// tau-b with its interval and a permutation test, by all permutations up to 9 items, else by random ones (Phipson and
/// Smyth 2010). Deterministic. Throws InputError: not one value of each list for each item, or values that are not
/// finite.
RankCorrelation rank_correlation(const std::vector<double>& a, const std::vector<double>& b, int resamples = 2000,
                                 std::uint64_t seed = 1);

/// {items, tau_b, ci95, interval, p_value, exact}.
nlohmann::json to_json(const RankCorrelation& correlation);

}  // namespace tileflight::evaluation
