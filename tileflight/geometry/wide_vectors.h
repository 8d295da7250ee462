#pragma once

// A function marked TILEFLIGHT_WIDE_VECTORS is compiled twice and the processor's own kind is taken when the program
// starts; as nothing is fused or reordered, both give the same bits.
#if defined(__x86_64__) && defined(__GNUC__) && !defined(__clang__) && !defined(__SANITIZE_ADDRESS__)
#define TILEFLIGHT_WIDE_VECTORS __attribute__((target_clones("avx2", "default")))
#else
#define TILEFLIGHT_WIDE_VECTORS
#endif
/// Parts of such a function: they must become part of both copies.
#define TILEFLIGHT_LANE_INLINE inline __attribute__((always_inline))
