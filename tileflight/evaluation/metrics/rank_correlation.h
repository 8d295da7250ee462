#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

namespace tileflight::metrics {

/// Returns Kendall's tau-b (Biometrika 33, 1945): agreement of the orders of two lists of values for the same items, -1
/// to 1, corrected for ties. NaN if one of the lists is constant.
double kendall_tau_b(const std::vector<double>& a, const std::vector<double>& b);

/// 95 % interval of tau-b, with the items as a random sample.
struct TauInterval {
  std::array<double, 2> ci95{std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::quiet_NaN()};
  std::string method = "none";  ///< or "bootstrap", "fieller"
};

/// Computes the interval of tau-b. From 8 items on it is the percentile bootstrap over items. From 5 to 7 (too few for
/// a bootstrap), and if all resamples agree, it is the interval of Fieller, Hartley and Pearson (Biometrika 44, 1957:
/// Fisher's z of tau with variance 0.437 / (n - 4)), widened by one discordant pair because tau takes few values there;
/// its coverage exceeds 95 %. Below 5 items there is none.
TauInterval tau_interval(const std::vector<double>& a, const std::vector<double>& b, int resamples, std::uint64_t seed);

struct RankCorrelation {
  std::size_t items = 0;
  double tau_b = std::numeric_limits<double>::quiet_NaN();
  TauInterval interval;
  double p_value = std::numeric_limits<double>::quiet_NaN();  ///< two-sided, for independent orders
  bool exact = false;                                         ///< over all permutations instead of random ones
};

/// Computes tau-b with its interval and a permutation test, over all permutations up to 9 items, else over random ones
/// (Phipson and Smyth 2010). Deterministic. Throws InputError for lists of different lengths or non-finite values.
RankCorrelation rank_correlation(const std::vector<double>& a, const std::vector<double>& b, int resamples = 2000,
                                 std::uint64_t seed = 1);

/// Returns {items, tau_b, ci95, interval, p_value, exact}.
nlohmann::json to_json(const RankCorrelation& correlation);

}  // namespace tileflight::metrics
