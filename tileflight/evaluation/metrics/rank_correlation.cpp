#include "tileflight/evaluation/metrics/rank_correlation.h"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <numeric>

#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/random_numbers.h"
#include "tileflight/evaluation/metrics/block_bootstrap.h"

namespace tileflight::metrics {

namespace {

using Indices = std::vector<std::size_t>;

constexpr std::size_t kMaxForAllPermutations = 9;
constexpr std::size_t kMinForBootstrap = 8;
constexpr std::size_t kMinForInterval = 5;

int sign(double v) { return (v > 0.0) - (v < 0.0); }

/// Number of concordant minus discordant pairs; `of_a` and `of_b` select the values.
std::int64_t concordance(const std::vector<double>& a, const Indices& of_a, const std::vector<double>& b,
                         const Indices& of_b) {
  std::int64_t sum = 0;
  for (std::size_t i = 0; i < of_a.size(); ++i) {
    for (std::size_t j = 0; j < i; ++j) sum += sign(a[of_a[i]] - a[of_a[j]]) * sign(b[of_b[i]] - b[of_b[j]]);
  }
  return sum;
}

/// Number of pairs with different values.
double untied_pairs(const std::vector<double>& values, const Indices& of) {
  return static_cast<double>(concordance(values, of, values, of));
}

double tau_of(const std::vector<double>& a, const std::vector<double>& b, const Indices& items) {
  const double pairs = std::sqrt(untied_pairs(a, items) * untied_pairs(b, items));
  if (pairs == 0.0) return std::numeric_limits<double>::quiet_NaN();
  return std::clamp(static_cast<double>(concordance(a, items, b, items)) / pairs, -1.0, 1.0);
}

Indices first_n(std::size_t n) {
  Indices indices(n);
  std::iota(indices.begin(), indices.end(), std::size_t{0});
  return indices;
}

void shuffle(Indices& indices, base::SplitMix64& random) {
  for (std::size_t i = indices.size(); i > 1; --i) std::swap(indices[i - 1], indices[random.below(i)]);
}

/// Share of all permutations with at least the observed absolute concordance.
double exact_p_value(const std::vector<double>& a, const std::vector<double>& b) {
  const Indices items = first_n(a.size());
  const std::int64_t found = std::abs(concordance(a, items, b, items));
  std::size_t as_far = 0, all = 0;
  Indices permuted = items;
  do {
    as_far += std::abs(concordance(a, items, b, permuted)) >= found;
    ++all;
  } while (std::next_permutation(permuted.begin(), permuted.end()));
  return static_cast<double>(as_far) / static_cast<double>(all);
}

double random_p_value(const std::vector<double>& a, const std::vector<double>& b, std::uint64_t seed) {
  constexpr std::size_t kPermutations = 9999;
  const Indices items = first_n(a.size());
  const std::int64_t found = std::abs(concordance(a, items, b, items));
  base::SplitMix64 random(seed);
  Indices permuted = items;
  std::size_t as_far = 1;  // includes the observed order
  for (std::size_t k = 0; k < kPermutations; ++k) {
    shuffle(permuted, random);
    as_far += std::abs(concordance(a, items, b, permuted)) >= found;
  }
  return static_cast<double>(as_far) / static_cast<double>(kPermutations + 1);
}

/// NaN if all resamples agree.
std::array<double, 2> bootstrap_interval(const std::vector<double>& a, const std::vector<double>& b, int resamples,
                                         std::uint64_t seed) {
  base::SplitMix64 random(seed);
  std::vector<double> taus;
  for (int k = 0; k < resamples; ++k) {
    Indices drawn(a.size());
    for (std::size_t& item : drawn) item = random.below(a.size());
    const double tau = tau_of(a, b, drawn);
    if (!std::isnan(tau)) taus.push_back(tau);
  }
  std::sort(taus.begin(), taus.end());
  if (taus.empty() || taus.front() == taus.back()) return {std::nan(""), std::nan("")};
  return {quantile(taus, 0.025), quantile(taus, 0.975)};
}

std::array<double, 2> fieller_interval(double tau, std::size_t items) {
  const auto n = static_cast<double>(items);
  const double one_pair = 4.0 / (n * (n - 1.0)), half_width = kNormal975 * std::sqrt(0.437 / (n - 4.0));
  const double low = tau - one_pair, high = tau + one_pair;
  return {low <= -1.0 ? -1.0 : std::tanh(std::atanh(low) - half_width),
          high >= 1.0 ? 1.0 : std::tanh(std::atanh(high) + half_width)};
}

void check(const std::vector<double>& values) {
  if (!std::ranges::all_of(values, [](double v) { return std::isfinite(v); }))
    throw InputError("ranking", "a score is not a number; leave out the items without a score");
}

}  // namespace

TauInterval tau_interval(const std::vector<double>& a, const std::vector<double>& b, int resamples,
                         std::uint64_t seed) {
  const double tau = kendall_tau_b(a, b);
  if (std::isnan(tau) || a.size() < kMinForInterval) return {};
  if (a.size() >= kMinForBootstrap) {
    const std::array<double, 2> ci95 = bootstrap_interval(a, b, resamples, seed);
    if (!std::isnan(ci95[0])) return {ci95, "bootstrap"};
  }
  return {fieller_interval(tau, a.size()), "fieller"};
}

double kendall_tau_b(const std::vector<double>& a, const std::vector<double>& b) {
  if (a.size() != b.size()) throw InputError("ranking", "the two lists must have the same items");
  return tau_of(a, b, first_n(a.size()));
}

RankCorrelation rank_correlation(const std::vector<double>& a, const std::vector<double>& b, int resamples,
                                 std::uint64_t seed) {
  check(a);
  check(b);
  RankCorrelation result;
  result.items = a.size();
  result.tau_b = kendall_tau_b(a, b);
  if (std::isnan(result.tau_b)) return result;
  result.interval = tau_interval(a, b, resamples, seed);
  result.exact = result.items <= kMaxForAllPermutations;
  result.p_value = result.exact ? exact_p_value(a, b) : random_p_value(a, b, seed);
  return result;
}

nlohmann::json to_json(const RankCorrelation& c) {
  return {{"items", c.items},     {"tau_b", c.tau_b}, {"ci95", c.interval.ci95}, {"interval", c.interval.method},
          {"p_value", c.p_value}, {"exact", c.exact}};
}

}  // namespace tileflight::metrics
