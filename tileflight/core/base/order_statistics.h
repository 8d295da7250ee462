#pragma once

#include <algorithm>
#include <cstddef>
#include <vector>

namespace tileflight::base {

/// The median; of an even number of values the upper one of the two in the middle. `values` must not be empty. Linear
/// time.
template <class Value>
Value upper_median(std::vector<Value> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

/// The value at `share` (0 to 1) of the way through the values in order; between two values the lower one. `values`
/// must not be empty. Linear time.
inline double lower_quantile(std::vector<double> values, double share) {
  const auto at = values.begin() + static_cast<std::ptrdiff_t>(share * static_cast<double>(values.size() - 1));
  std::nth_element(values.begin(), at, values.end());
  return *at;
}

/// The median; of an even number of values the mean of the two in the middle. `values` must not be empty and is
/// reordered.
inline double median(std::vector<double>& values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  if (values.size() % 2 == 1) return *middle;
  return 0.5 * (*std::max_element(values.begin(), middle) + *middle);
}

}  // namespace tileflight::base
