#pragma once

// Eight floats processed at once, for pixel loops: the compiler's vector type, available in some form on every
// processor.

#include <array>
#include <cmath>
#include <cstring>

#include "tileflight/base/wide_vectors.h"

namespace tileflight::base {

inline constexpr int kLanes = 8;
using Float8 = float __attribute__((vector_size(32)));
using Mask8 = int __attribute__((vector_size(32)));  ///< -1: true, 0: false

/// Results are written through references: passing or returning a vector by value has no calling convention common to
/// all processors.
TILEFLIGHT_LANE_INLINE void load_float8(const float* from, Float8& to) { std::memcpy(&to, from, sizeof(to)); }
TILEFLIGHT_LANE_INLINE void store_float8(const Float8& from, float* to) { std::memcpy(to, &from, sizeof(from)); }

TILEFLIGHT_LANE_INLINE void square_root(const Float8& x, Float8& root) {
  for (int i = 0; i < kLanes; ++i) root[i] = std::sqrt(x[i]);
}
TILEFLIGHT_LANE_INLINE void absolute(const Float8& x, Float8& out) { out = x < 0.0F ? -x : x; }

/// Sum of the eight elements in a fixed order.
TILEFLIGHT_LANE_INLINE float horizontal_sum(const Float8& x) {
  return ((x[0] + x[4]) + (x[2] + x[6])) + ((x[1] + x[5]) + (x[3] + x[7]));
}

/// Weights of a Huber norm (huber_weight of patch.h).
TILEFLIGHT_LANE_INLINE void huber_weights(const Float8& residual, float huber, Float8& weight) {
  Float8 size;
  absolute(residual, size);
  weight = size < huber ? Float8{} + 1.0F : huber / size;
}

}  // namespace tileflight::base
