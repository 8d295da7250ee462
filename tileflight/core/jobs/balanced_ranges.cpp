#include "tileflight/core/jobs/balanced_ranges.h"

#include <algorithm>
#include <numeric>

namespace tileflight::jobs {

std::vector<IndexRange> balanced_ranges(const std::vector<double>& costs, std::size_t count) {
  const double total = std::accumulate(costs.begin(), costs.end(), 0.0);
  std::vector<IndexRange> ranges(count, {costs.size(), costs.size()});
  // A work belongs to the range in whose share its middle lies; works without cost are spread by number.
  double before = 0.0;
  std::size_t last = 0;
  for (std::size_t i = 0; i < costs.size(); ++i) {
    const double middle = total > 0.0 ? (before + 0.5 * costs[i]) / total
                                      : (static_cast<double>(i) + 0.5) / static_cast<double>(costs.size());
    const auto range = static_cast<std::size_t>(middle * static_cast<double>(count));
    before += costs[i];
    last = std::clamp(range, last, count - 1);
    if (ranges[last].begin == costs.size()) ranges[last].begin = i;
    ranges[last].end = i + 1;
  }
  for (std::size_t k = count; k-- > 0;) {
    if (ranges[k].begin == costs.size())
      ranges[k].begin = ranges[k].end = k + 1 < count ? ranges[k + 1].begin : costs.size();
  }
  return ranges;
}

}  // namespace tileflight::jobs
