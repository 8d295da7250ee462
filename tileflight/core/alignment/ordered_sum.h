#pragma once

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cstddef>
#include <vector>

namespace tileflight::alignment {

/// Sums `part(begin, end)` over fixed chunks of [0, n). Chunks are computed in parallel and added in order, so that the
/// sum is bit-identical for any number of threads.
template <class Sum, class Part>
Sum ordered_sum(std::size_t n, const Part& part) {
  constexpr std::size_t kChunk = 1024;
  const std::size_t chunks = (n + kChunk - 1) / kChunk;
  std::vector<Sum> partial(chunks);
  tbb::parallel_for(std::size_t{0}, chunks,
                    [&](std::size_t c) { partial[c] = part(c * kChunk, std::min(n, (c + 1) * kChunk)); });
  Sum total{};
  for (const Sum& p : partial) total += p;
  return total;
}

}  // namespace tileflight::alignment
