#pragma once

#include <cstddef>
#include <vector>

namespace tileflight::jobs {

/// Half-open range of indices [begin, end).
struct IndexRange {
  std::size_t begin = 0, end = 0;

  std::size_t size() const { return end - begin; }
  bool contains(std::size_t i) const { return i >= begin && i < end; }
  bool operator==(const IndexRange&) const = default;
};

/// Divides a list of work items with the given costs (>= 0) into `count` consecutive ranges of about equal cost: no
/// range costs more than an even share plus the most expensive item. Ranges may be empty.
std::vector<IndexRange> balanced_ranges(const std::vector<double>& costs, std::size_t count);

}  // namespace tileflight::jobs
