#pragma once

#include <cstddef>
#include <vector>

namespace tileflight::workflow {

/// Indices from begin to end, without end.
struct IndexRange {
  std::size_t begin = 0, end = 0;

  std::size_t size() const { return end - begin; }
  bool contains(std::size_t i) const { return i >= begin && i < end; }
  bool operator==(const IndexRange&) const = default;
};

/// Cuts a list of works, whose costs are given (>= 0), into `count` ranges of about the same cost, in order: none costs
/// more than its even share and the dearest work together. Some may be empty.
std::vector<IndexRange> balanced_ranges(const std::vector<double>& costs, std::size_t count);

}  // namespace tileflight::workflow
