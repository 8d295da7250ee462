#pragma once

// A function marked TILEFLIGHT_WIDE_VECTORS is compiled twice, for AVX2 and for the baseline; the variant is chosen
// when the program starts. No operations are fused or reordered, so both give the same bits.
#if defined(__x86_64__) && defined(__GNUC__) && !defined(__clang__) && !defined(__SANITIZE_ADDRESS__)
#define TILEFLIGHT_WIDE_VECTORS __attribute__((target_clones("avx2", "default")))
#else
#define TILEFLIGHT_WIDE_VECTORS
#endif
/// Marks helpers of such a function: they must be inlined into both variants.
#define TILEFLIGHT_LANE_INLINE inline __attribute__((always_inline))
