#pragma once

// Sums over SIMD lanes, four at once: a residual needs fifteen.

#include "tileflight/core/base/simd.h"

namespace tileflight::keyframes {

/// base::horizontal_sum() of each, to the same bits, in little more time than one takes.
TILEFLIGHT_LANE_INLINE void sum_lanes(const base::Float8& a, const base::Float8& b, const base::Float8& c,
                                      const base::Float8& d, base::Float4& sums) {
  const auto half = [](const base::Float8& x) __attribute__((always_inline)) {
    return __builtin_shufflevector(x, x, 0, 1, 2, 3) + __builtin_shufflevector(x, x, 4, 5, 6, 7);
  };
  const base::Float4 a4 = half(a), b4 = half(b), c4 = half(c), d4 = half(d);
  const base::Float4 ab = __builtin_shufflevector(a4, b4, 0, 4, 1, 5) + __builtin_shufflevector(a4, b4, 2, 6, 3, 7);
  const base::Float4 cd = __builtin_shufflevector(c4, d4, 0, 4, 1, 5) + __builtin_shufflevector(c4, d4, 2, 6, 3, 7);
  sums = __builtin_shufflevector(ab, cd, 0, 1, 4, 5) + __builtin_shufflevector(ab, cd, 2, 3, 6, 7);
}

}  // namespace tileflight::keyframes
