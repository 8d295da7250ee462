#pragma once

#include <algorithm>
#include <cstddef>
#include <vector>

namespace tileflight::base {

/// Returns the median; for an even number of values, the upper one of the two in the middle. Linear time. Precondition:
/// `values` is not empty.
template <class Value>
Value upper_median(std::vector<Value> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

/// Returns the value at `share` (0 to 1) of the way through the sorted values; between two values, the lower one.
/// Linear time. Precondition: `values` is not empty.
inline double lower_quantile(std::vector<double> values, double share) {
  const auto at = values.begin() + static_cast<std::ptrdiff_t>(share * static_cast<double>(values.size() - 1));
  std::nth_element(values.begin(), at, values.end());
  return *at;
}

/// Returns the median; for an even number of values, the mean of the two in the middle. Reorders `values`.
/// Precondition: they are not empty.
inline double median(std::vector<double>& values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  if (values.size() % 2 == 1) return *middle;
  return 0.5 * (*std::max_element(values.begin(), middle) + *middle);
}

}  // namespace tileflight::base
