#include "tileflight/evaluation/metrics/distribution_distances.h"

#include <algorithm>
#include <cassert>
#include <cmath>

namespace tileflight::metrics {

namespace {

/// Calls `step(difference, length)` for every interval between neighbouring values of the two samples: difference of
/// the distribution functions on it, and its length.
template <class Step>
void walk_distributions(std::vector<double> a, std::vector<double> b, const Step& step) {
  assert(!a.empty() && !b.empty());
  std::sort(a.begin(), a.end());
  std::sort(b.begin(), b.end());
  std::size_t i = 0, j = 0;
  while (i < a.size() || j < b.size()) {
    const bool from_a = j == b.size() || (i < a.size() && a[i] <= b[j]);
    const double value = from_a ? a[i] : b[j];
    while (i < a.size() && a[i] == value) ++i;
    while (j < b.size() && b[j] == value) ++j;
    if (i == a.size() && j == b.size()) break;  // both functions are one from here on
    const double next = i == a.size() ? b[j] : j == b.size() ? a[i] : std::min(a[i], b[j]);
    const double share_a = static_cast<double>(i) / static_cast<double>(a.size());
    const double share_b = static_cast<double>(j) / static_cast<double>(b.size());
    step(std::abs(share_a - share_b), next - value);
  }
}

}  // namespace

double ks_statistic(std::vector<double> a, std::vector<double> b) {
  double largest = 0.0;
  walk_distributions(std::move(a), std::move(b),
                     [&](double difference, double) { largest = std::max(largest, difference); });
  return largest;
}

double wasserstein_distance(std::vector<double> a, std::vector<double> b) {
  double area = 0.0;
  walk_distributions(std::move(a), std::move(b),
                     [&](double difference, double length) { area += difference * length; });
  return area;
}

}  // namespace tileflight::metrics
