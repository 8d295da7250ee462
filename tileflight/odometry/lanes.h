#pragma once

// Eight numbers at once, for the loops over pixels: the compiler's vector type, which every processor has in one form
// or another.

#include <array>
#include <cmath>
#include <cstring>

#include "tileflight/geometry/wide_vectors.h"

namespace tileflight::odometry {

inline constexpr int kLanes = 8;
using Lanes = float __attribute__((vector_size(32)));
using LaneMask = int __attribute__((vector_size(32)));  ///< -1: yes, 0: no

/// Results are written through references: a vector as an argument or a result has no calling convention that all
/// processors share.
TILEFLIGHT_LANE_INLINE void load_lanes(const float* from, Lanes& to) { std::memcpy(&to, from, sizeof(to)); }
TILEFLIGHT_LANE_INLINE void store_lanes(const Lanes& from, float* to) { std::memcpy(to, &from, sizeof(from)); }

TILEFLIGHT_LANE_INLINE void square_root(const Lanes& x, Lanes& root) {
  for (int i = 0; i < kLanes; ++i) root[i] = std::sqrt(x[i]);
}
TILEFLIGHT_LANE_INLINE void magnitude(const Lanes& x, Lanes& out) { out = x < 0.0F ? -x : x; }

/// Sum in a fixed order.
TILEFLIGHT_LANE_INLINE float lane_sum(const Lanes& x) {
  return ((x[0] + x[4]) + (x[2] + x[6])) + ((x[1] + x[5]) + (x[3] + x[7]));
}

/// Weights of a Huber norm (huber_weight of patch.h).
TILEFLIGHT_LANE_INLINE void huber_weights(const Lanes& residual, float huber, Lanes& weight) {
  Lanes size;
  magnitude(residual, size);
  weight = size < huber ? Lanes{} + 1.0F : huber / size;
}

}  // namespace tileflight::odometry
