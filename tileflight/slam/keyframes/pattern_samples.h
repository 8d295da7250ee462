#pragma once

// Eight pixels of a pyramid level read at once, with the same bits as PyramidLevel::sample and sample_intensity.

#include "tileflight/core/base/simd.h"
#include "tileflight/slam/keyframes/patch.h"

namespace tileflight::keyframes {

/// Grey values and their central differences at eight pixels.
struct PatternSamples8 {
  base::Float8 grey, gx, gy;
};

/// Whole pixels and the shares of the next ones.
struct PixelCells8 {
  base::Int8 x, y;
  base::Float8 dx, dy;

  TILEFLIGHT_LANE_INLINE PixelCells8(const base::Float8& u, const base::Float8& v)
      : x(__builtin_convertvector(u, base::Int8)), y(__builtin_convertvector(v, base::Int8)) {
    dx = u - __builtin_convertvector(x, base::Float8);
    dy = v - __builtin_convertvector(y, base::Float8);
  }
  /// Returns the index of the whole pixel of `lane` in the level's grey values.
  TILEFLIGHT_LANE_INLINE std::ptrdiff_t index(const PyramidLevel& level, int lane) const {
    return static_cast<std::ptrdiff_t>(y[lane]) * level.width + x[lane];
  }
};

/// Four values from each of two places.
TILEFLIGHT_LANE_INLINE void load_two_fours(const float* first, const float* second, base::Float8& out) {
  base::Float4 halves[2];
  std::memcpy(&halves[0], first, sizeof(halves[0]));
  std::memcpy(&halves[1], second, sizeof(halves[1]));
  out = __builtin_shufflevector(halves[0], halves[1], 0, 1, 2, 3, 4, 5, 6, 7);
}

/// Column `part` (0 to 3) of four values of eight pixels, where rows[k] has those of pixels k and k + 4.
template <int part>
TILEFLIGHT_LANE_INLINE void gather_part(const std::array<base::Float8, 4>& rows, base::Float8& out) {
  const base::Float8 first = __builtin_shufflevector(rows[0], rows[1], part, 8 + part, part, 8 + part, 4 + part,
                                                     12 + part, 4 + part, 12 + part);
  const base::Float8 second = __builtin_shufflevector(rows[2], rows[3], part, 8 + part, part, 8 + part, 4 + part,
                                                      12 + part, 4 + part, 12 + part);
  out = __builtin_shufflevector(first, second, 0, 1, 8, 9, 4, 5, 12, 13);
}

/// Samples the level at (u, v) of each lane, as PyramidLevel::sample does.
TILEFLIGHT_LANE_INLINE void sample_eight(const PyramidLevel& level, const base::Float8& u, const base::Float8& v,
                                         PatternSamples8& out) {
  const PixelCells8 cells(u, v);
  std::array<base::Float8, 4> here, down;  // of two pixels each, at columns x - 1 ... x + 2
  for (int k = 0; k < 4; ++k) {
    const float* p = level.grey.data() + cells.index(level, k) - 1;
    const float* q = level.grey.data() + cells.index(level, k + 4) - 1;
    const std::ptrdiff_t w = level.width;
    base::Float8 above, top, bottom, below;
    load_two_fours(p - w, q - w, above);
    load_two_fours(p, q, top);
    load_two_fours(p + w, q + w, bottom);
    load_two_fours(p + 2 * w, q + 2 * w, below);
    const float a = cells.dy[k], b = cells.dy[k + 4];
    const base::Float8 dy{a, a, a, a, b, b, b, b};
    here[k] = top + dy * (bottom - top);
    down[k] = (bottom - above) + dy * ((below - top) - (bottom - above));
  }
  base::Float8 h0, h1, h2, h3, d1, d2;
  gather_part<0>(here, h0), gather_part<1>(here, h1), gather_part<2>(here, h2), gather_part<3>(here, h3);
  gather_part<1>(down, d1), gather_part<2>(down, d2);
  const base::Float8 left = h2 - h0, right = h3 - h1;
  out.grey = h1 + cells.dx * (h2 - h1);
  out.gx = 0.5F * (left + cells.dx * (right - left));
  out.gy = 0.5F * (d1 + cells.dx * (d2 - d1));
}

/// Between the two floats of each of eight pairs; a pair is in the bits of one number.
TILEFLIGHT_LANE_INLINE void interpolate_pairs(const double* pairs, const base::Float8& dx, base::Float8& out) {
  const base::Double4 a{pairs[0], pairs[1], pairs[4], pairs[5]}, b{pairs[2], pairs[3], pairs[6], pairs[7]};
  base::Float8 first, second;
  std::memcpy(&first, &a, sizeof(a));
  std::memcpy(&second, &b, sizeof(b));
  const base::Float8 left = __builtin_shufflevector(first, second, 0, 2, 8, 10, 4, 6, 12, 14);
  const base::Float8 right = __builtin_shufflevector(first, second, 1, 3, 9, 11, 5, 7, 13, 15);
  out = left + dx * (right - left);
}

/// Samples the level's intensity at (u, v) of each lane, as PyramidLevel::sample_intensity does.
TILEFLIGHT_LANE_INLINE void sample_eight_intensities(const PyramidLevel& level, const base::Float8& u,
                                                     const base::Float8& v, base::Float8& grey) {
  const PixelCells8 cells(u, v);
  double upper[base::kLanes], lower[base::kLanes];
  for (int k = 0; k < base::kLanes; ++k) {
    const float* p = level.grey.data() + cells.index(level, k);
    std::memcpy(&upper[k], p, sizeof(double));
    std::memcpy(&lower[k], p + level.width, sizeof(double));
  }
  base::Float8 top, bottom;
  interpolate_pairs(upper, cells.dx, top);
  interpolate_pairs(lower, cells.dx, bottom);
  grey = top + cells.dy * (bottom - top);
}

}  // namespace tileflight::keyframes
