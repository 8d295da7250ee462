#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>
#ifdef __SSE2__
#include <emmintrin.h>
#endif

#include "tileflight/base/wide_vectors.h"

// Vectors of eight floats or integers, for functions marked TILEFLIGHT_WIDE_VECTORS. Compile with -Wno-psabi: the
// helpers are always inlined, so the calling convention of such values does not matter.
namespace tileflight::scene {

using Float8 = float __attribute__((vector_size(32)));
using Int8 = std::int32_t __attribute__((vector_size(32)));

TILEFLIGHT_LANE_INLINE Float8 load(const float (&from)[8]) {
  Float8 lanes;
  std::memcpy(&lanes, from, sizeof(lanes));
  return lanes;
}

TILEFLIGHT_LANE_INLINE void store(const Float8& lanes, float (&to)[8]) { std::memcpy(to, &lanes, sizeof(lanes)); }

TILEFLIGHT_LANE_INLINE void store(const Int8& lanes, std::uint32_t (&to)[8]) { std::memcpy(to, &lanes, sizeof(lanes)); }

TILEFLIGHT_LANE_INLINE Float8 lane_min(const Float8& a, const Float8& b) { return a < b ? a : b; }
TILEFLIGHT_LANE_INLINE Float8 lane_max(const Float8& a, const Float8& b) { return a > b ? a : b; }

TILEFLIGHT_LANE_INLINE Float8 lane_abs(const Float8& a) { return (Float8)((Int8)a & 0x7FFFFFFF); }

/// The sign bits of the lanes: bit i is that of lane i.
TILEFLIGHT_LANE_INLINE unsigned sign_mask(const Int8& lanes) {
#ifdef __SSE2__
  __m128 halves[2];
  std::memcpy(halves, &lanes, sizeof(halves));
  return static_cast<unsigned>(_mm_movemask_ps(halves[0])) | static_cast<unsigned>(_mm_movemask_ps(halves[1])) << 4U;
#else
  unsigned bits = 0;
  for (int i = 0; i < 8; ++i) bits |= (static_cast<std::uint32_t>(lanes[i]) >> 31U) << static_cast<unsigned>(i);
  return bits;
#endif
}
TILEFLIGHT_LANE_INLINE unsigned sign_mask(const Float8& lanes) { return sign_mask((Int8)lanes); }

/// Minimum of the eight lanes.
TILEFLIGHT_LANE_INLINE float horizontal_min(const Float8& lanes) {
  const Float8 fours = lane_min(lanes, __builtin_shufflevector(lanes, lanes, 4, 5, 6, 7, 0, 1, 2, 3));
  const Float8 twos = lane_min(fours, __builtin_shufflevector(fours, fours, 2, 3, 0, 1, 6, 7, 4, 5));
  return twos[0] < twos[1] ? twos[0] : twos[1];
}

}  // namespace tileflight::scene
