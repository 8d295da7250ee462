#pragma once

// The compiler's vector types (GCC and Clang), available in some form on every processor, and functions on them for hot
// loops. Operations act on each element as on a single number, so results do not depend on the processor.

#include <array>
#include <cmath>
#include <cstdint>
#include <cstring>
#ifdef __SSE2__
#include <emmintrin.h>
#endif

// A function marked TILEFLIGHT_WIDE_VECTORS is compiled twice, for AVX2 and for the baseline; the variant is chosen
// when the program starts. No operations are fused or reordered, so both give the same bits.
#if defined(__x86_64__) && defined(__GNUC__) && !defined(__clang__) && !defined(__SANITIZE_ADDRESS__)
#define TILEFLIGHT_WIDE_VECTORS __attribute__((target_clones("avx2", "default")))
#else
#define TILEFLIGHT_WIDE_VECTORS
#endif
/// Marks helpers of such a function: they must be inlined into both variants.
#define TILEFLIGHT_LANE_INLINE inline __attribute__((always_inline))

namespace tileflight::base {

inline constexpr int kLanes = 8;
using Float8 = float __attribute__((vector_size(32)));
using Int8 = std::int32_t __attribute__((vector_size(32)));
using Mask8 = Int8;  ///< -1: true, 0: false
using Float4 = float __attribute__((vector_size(16)));
using Int4 = std::int32_t __attribute__((vector_size(16)));
using Double4 = double __attribute__((vector_size(32)));
using Mask4 = long long __attribute__((vector_size(32)));  ///< of Double4; -1: true, 0: false

// Results are written through references: passing or returning a vector of 32 bytes by value has no calling convention
// common to all processors.
TILEFLIGHT_LANE_INLINE void load_float8(const float* from, Float8& to) { std::memcpy(&to, from, sizeof(to)); }
TILEFLIGHT_LANE_INLINE void store_float8(const Float8& from, float* to) { std::memcpy(to, &from, sizeof(from)); }

TILEFLIGHT_LANE_INLINE void square_root(const Float8& x, Float8& root) {
  for (int i = 0; i < kLanes; ++i) root[i] = std::sqrt(x[i]);
}
TILEFLIGHT_LANE_INLINE void absolute(const Float8& x, Float8& out) { out = x < 0.0F ? -x : x; }

/// Adds the eight elements in a fixed order.
TILEFLIGHT_LANE_INLINE float horizontal_sum(const Float8& x) {
  return ((x[0] + x[4]) + (x[2] + x[6])) + ((x[1] + x[5]) + (x[3] + x[7]));
}

/// Computes the weights of a Huber norm: 1 within `huber`, then huber / |r|. The energy is weight * r^2 * (2 - weight).
TILEFLIGHT_LANE_INLINE void huber_weights(const Float8& residual, float huber, Float8& weight) {
  Float8 size;
  absolute(residual, size);
  weight = size < huber ? Float8{} + 1.0F : huber / size;
}

/// Collects the sign bits of the elements: bit i is that of element i.
TILEFLIGHT_LANE_INLINE unsigned sign_mask(const Int8& lanes) {
#ifdef __SSE2__
  __m128 halves[2];
  std::memcpy(halves, &lanes, sizeof(halves));
  return static_cast<unsigned>(_mm_movemask_ps(halves[0])) | static_cast<unsigned>(_mm_movemask_ps(halves[1])) << 4U;
#else
  unsigned bits = 0;
  for (int i = 0; i < kLanes; ++i) bits |= (static_cast<std::uint32_t>(lanes[i]) >> 31U) << static_cast<unsigned>(i);
  return bits;
#endif
}

/// Returns the minimum of the eight elements.
TILEFLIGHT_LANE_INLINE float horizontal_min(const Float8& x) {
  const Float8 half = __builtin_shufflevector(x, x, 4, 5, 6, 7, 0, 1, 2, 3);
  const Float8 fours = x < half ? x : half;
  const Float8 quarter = __builtin_shufflevector(fours, fours, 2, 3, 0, 1, 6, 7, 4, 5);
  const Float8 twos = fours < quarter ? fours : quarter;
  return twos[0] < twos[1] ? twos[0] : twos[1];
}

}  // namespace tileflight::base
