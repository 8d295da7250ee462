#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>

#include "tileflight/capture/render/mip_pyramid.h"
#include "tileflight/core/base/simd.h"
#include "tileflight/core/imaging/textured_mesh.h"

// Filtered texture reads, inlined into the renderer's pixel loop; footprint.h determines their number and level.
//
// The weights apply to squared values, because squares approximate linear light (sRGB's curve is close to a power of 2)
// and are exact if neighbours are equal; mip levels are averaged in exact linear light.
namespace tileflight::render {

using base::Float4;  // red, green, blue, undefined
using base::Float8;

/// A texture and its sampling parameters.
struct Texture {
  const MipPyramid* pyramid = nullptr;
  imaging::Wrap wrap_s = imaging::Wrap::kRepeat;
  imaging::Wrap wrap_t = imaging::Wrap::kRepeat;
  float width = 1.0F, height = 1.0F;  ///< of level 0, texels
};

/// Position and filter of a read: `probes` trilinear reads along a line centred at (s, t), spaced by (step_s, step_t),
/// at level `lod`.
struct TextureRead {
  float s = 0.0F, t = 0.0F;            ///< texture coordinates
  float step_s = 0.0F, step_t = 0.0F;  ///< texture coordinates
  int probes = 1;
  float lod = 0.0F;  ///< 0 to the pyramid's coarsest level
};

namespace sampling {

inline int floor_to_int(float x) {
  const int truncated = static_cast<int>(x);
  return truncated - (static_cast<float>(truncated) > x ? 1 : 0);
}

/// Maps a texture coordinate to 0..1 by the wrap mode.
inline float wrap_coordinate(float s, imaging::Wrap wrap) {
  if (s >= 0.0F && s <= 1.0F) return s;
  if (wrap == imaging::Wrap::kClampToEdge) return std::clamp(s, 0.0F, 1.0F);
  if (wrap == imaging::Wrap::kRepeat) return s - std::floor(s);
  const float twofold = s - 2.0F * std::floor(0.5F * s);
  return twofold <= 1.0F ? twofold : 2.0F - twofold;
}

/// Maps a texel index near 0..size - 1 into that range.
inline int wrap_index(int i, int size, imaging::Wrap wrap) {
  if (i >= 0 && i < size) return i;
  if (wrap == imaging::Wrap::kClampToEdge) return std::clamp(i, 0, size - 1);
  const int period = wrap == imaging::Wrap::kRepeat ? size : 2 * size;
  const int inside = ((i % period) + period) % period;
  return inside < size ? inside : 2 * size - 1 - inside;
}

/// Two horizontally adjacent texels, by one load of eight bytes that never leaves the image.
inline std::uint64_t load_pair(const MipLevel& mip, std::ptrdiff_t texel) {
  const std::uint8_t* address = mip.texels + 3 * texel;
  const std::ptrdiff_t beyond = std::max<std::ptrdiff_t>(0, address - mip.last_load);
  std::uint64_t bits = 0;
  std::memcpy(&bits, address - beyond, sizeof(bits));
  return bits >> (8 * static_cast<unsigned>(beyond));
}

/// Pairs of horizontally adjacent texels of the upper and the lower row (load_pair()), as floats: rows in halves,
/// elements 3 and 7 are undefined.
TILEFLIGHT_LANE_INLINE void unpack(std::uint64_t upper, std::uint64_t lower, Float8& left, Float8& right) {
  using Bytes = std::uint8_t __attribute__((vector_size(32)));
  using Longs = std::uint64_t __attribute__((vector_size(32)));
  const auto rows = (Bytes)Longs{upper, upper, lower, lower};
  const Bytes zero{};
  // Each element takes a byte and three zeros.
  left = __builtin_convertvector(
      (base::Int8)__builtin_shufflevector(rows, zero, 0, 32, 32, 32, 1, 32, 32, 32, 2, 32, 32, 32, 3, 32, 32, 32, 16,
                                          48, 48, 48, 17, 48, 48, 48, 18, 48, 48, 48, 19, 48, 48, 48),
      Float8);
  right = __builtin_convertvector(
      (base::Int8)__builtin_shufflevector(rows, zero, 3, 32, 32, 32, 4, 32, 32, 32, 5, 32, 32, 32, 6, 32, 32, 32, 19,
                                          48, 48, 48, 20, 48, 48, 48, 21, 48, 48, 48, 22, 48, 48, 48),
      Float8);
}

/// Horizontal means of the squared texels of two rows, of each half a row.
TILEFLIGHT_LANE_INLINE void interpolate_rows(std::uint64_t upper, std::uint64_t lower, const Float8& left_weight,
                                             const Float8& right_weight, Float8& rows) {
  Float8 left, right;
  unpack(upper, lower, left, right);
  rows = left * left * left_weight + right * right * right_weight;
}

/// Bilinear mean of four squared texels: pairs of the upper and the lower row.
TILEFLIGHT_LANE_INLINE Float4 interpolate_squares(std::uint64_t upper_pair, std::uint64_t lower_pair, float fx,
                                                  float fy) {
  Float8 rows;
  interpolate_rows(upper_pair, lower_pair, Float8{} + (1.0F - fx), Float8{} + fx, rows);
  Float4 upper, lower;
  std::memcpy(&upper, &rows, sizeof(upper));
  std::memcpy(&lower, reinterpret_cast<const char*>(&rows) + sizeof(upper), sizeof(lower));
  return upper * (1.0F - fy) + lower * fy;
}

/// Bilinear mean of squared texels near the image's border, with wrapping.
inline Float4 bilinear_at_border(const Texture& texture, const MipLevel& mip, int x0, int y0, float fx, float fy) {
  const int left = wrap_index(x0, mip.width, texture.wrap_s);
  const int right = wrap_index(x0 + 1, mip.width, texture.wrap_s);
  const int top = wrap_index(y0, mip.height, texture.wrap_t);
  const int bottom = wrap_index(y0 + 1, mip.height, texture.wrap_t);
  const auto pair = [&](int y) {
    const auto texel = [&](int x) { return load_pair(mip, static_cast<std::ptrdiff_t>(y) * mip.width + x); };
    return (texel(left) & 0xFFFFFFU) | texel(right) << 24U;
  };
  return interpolate_squares(pair(top), pair(bottom), fx, fy);
}

/// Bilinear mean of squared texels; (x, y) in texels, centres at integers.
TILEFLIGHT_LANE_INLINE Float4 bilinear_squares(const Texture& texture, const MipLevel& mip, float x, float y) {
  const int x0 = floor_to_int(x);
  const int y0 = floor_to_int(y);
  const float fx = x - static_cast<float>(x0);
  const float fy = y - static_cast<float>(y0);
  const std::ptrdiff_t row = 3 * static_cast<std::ptrdiff_t>(mip.width);
  const std::ptrdiff_t upper = y0 * row + 3 * static_cast<std::ptrdiff_t>(x0);
  const bool inside =
      x0 >= 0 && y0 >= 0 && x0 + 1 < mip.width && y0 + 1 < mip.height && upper + row <= mip.last_load - mip.texels;
  if (!inside) [[unlikely]]
    return bilinear_at_border(texture, mip, x0, y0, fx, fy);
  std::uint64_t pairs[2];
  std::memcpy(&pairs[0], mip.texels + upper, sizeof(pairs[0]));
  std::memcpy(&pairs[1], mip.texels + upper + row, sizeof(pairs[1]));
  return interpolate_squares(pairs[0], pairs[1], fx, fy);
}

/// Sum of the probes' bilinear reads at one level.
TILEFLIGHT_LANE_INLINE Float4 probes_at_level(const Texture& texture, int level, const TextureRead& read) {
  const MipLevel& mip = texture.pyramid->level(level);
  const auto width = static_cast<float>(mip.width);
  const auto height = static_cast<float>(mip.height);
  const float first = -0.5F * static_cast<float>(read.probes - 1);
  float x = (read.s + first * read.step_s) * width - 0.5F;
  float y = (read.t + first * read.step_t) * height - 0.5F;
  Float4 sum = bilinear_squares(texture, mip, x, y);
  for (int i = 1; i < read.probes; ++i) {
    x += read.step_s * width;
    y += read.step_t * height;
    sum += bilinear_squares(texture, mip, x, y);
  }
  return sum;
}

/// Four numbers of two adjacent levels: for column and row of the finer one, and of the coarser one.
struct LevelPair {
  const MipLevel* mip[2];
  Float4 size;
  base::Int4 last_pair;     ///< largest index of a texel with a right, or lower, neighbour
  Float4 positions, steps;  ///< of a read's first probe and from probe to probe, texels, centres at integers
};

TILEFLIGHT_LANE_INLINE void set_up_pair(const Texture& texture, int level, const TextureRead& read, LevelPair& pair) {
  const MipLevel &fine = texture.pyramid->level(level), &coarse = texture.pyramid->level(level + 1);
  const base::Int4 size{fine.width, fine.height, coarse.width, coarse.height};
  pair.mip[0] = &fine;
  pair.mip[1] = &coarse;
  pair.size = __builtin_convertvector(size, Float4);
  pair.last_pair = size - 2;
  const Float4 center{read.s, read.t, read.s, read.t}, step{read.step_s, read.step_t, read.step_s, read.step_t};
  const float first = -0.5F * static_cast<float>(read.probes - 1);
  pair.positions = (center + first * step) * pair.size - 0.5F;
  pair.steps = step * pair.size;
}

TILEFLIGHT_LANE_INLINE bool has_negative(const base::Int4& numbers) {
#ifdef __SSE2__
  return _mm_movemask_ps((__m128)numbers) != 0;
#else
  return (numbers[0] | numbers[1] | numbers[2] | numbers[3]) < 0;
#endif
}

/// Bilinear means of squared texels at a position of both levels, the finer level's in the lower half.
TILEFLIGHT_LANE_INLINE void bilinear_squares(const Texture& texture, const LevelPair& pair, const Float4& positions,
                                             Float8& squares) {
  base::Int4 first = __builtin_convertvector(positions, base::Int4);
  first += __builtin_convertvector(first, Float4) > positions;  // rounded down
  const Float4 fraction = positions - __builtin_convertvector(first, Float4);
  bool inside = !has_negative(first | (pair.last_pair - first));
  std::ptrdiff_t at[2], row[2];
  for (int i = 0; i < 2; ++i) {
    row[i] = 3 * static_cast<std::ptrdiff_t>(pair.mip[i]->width);
    at[i] = first[2 * i + 1] * row[i] + 3 * static_cast<std::ptrdiff_t>(first[2 * i]);
    inside &= at[i] + row[i] <= pair.mip[i]->last_load - pair.mip[i]->texels;
  }
  if (!inside) [[unlikely]] {
    Float4 one[2];
    for (int i = 0; i < 2; ++i) {
      one[i] = bilinear_at_border(texture, *pair.mip[i], first[2 * i], first[2 * i + 1], fraction[2 * i],
                                  fraction[2 * i + 1]);
    }
    squares = __builtin_shufflevector(one[0], one[1], 0, 1, 2, 3, 4, 5, 6, 7);
    return;
  }
  const Float4 rest = 1.0F - fraction;
  Float8 rows[2];
  for (int i = 0; i < 2; ++i) {
    std::uint64_t upper = 0, lower = 0;
    std::memcpy(&upper, pair.mip[i]->texels + at[i], sizeof(upper));
    std::memcpy(&lower, pair.mip[i]->texels + at[i] + row[i], sizeof(lower));
    interpolate_rows(upper, lower, Float8{} + rest[2 * i], Float8{} + fraction[2 * i], rows[i]);
  }
  const Float8 uppers = __builtin_shufflevector(rows[0], rows[1], 0, 1, 2, 3, 8, 9, 10, 11);
  const Float8 lowers = __builtin_shufflevector(rows[0], rows[1], 4, 5, 6, 7, 12, 13, 14, 15);
  squares = uppers * __builtin_shufflevector(rest, rest, 1, 1, 1, 1, 3, 3, 3, 3) +
            lowers * __builtin_shufflevector(fraction, fraction, 1, 1, 1, 1, 3, 3, 3, 3);
}

/// Sums of the probes' bilinear reads at a level and at the next coarser one: probes_at_level() of both, to the bit.
TILEFLIGHT_LANE_INLINE void probes_at_levels(const Texture& texture, int level, const TextureRead& read, Float4& fine,
                                             Float4& coarse) {
  LevelPair pair;
  set_up_pair(texture, level, read, pair);
  Float4 positions = pair.positions;
  Float8 sum, squares;
  bilinear_squares(texture, pair, positions, sum);
  for (int i = 1; i < read.probes; ++i) {
    positions += pair.steps;
    bilinear_squares(texture, pair, positions, squares);
    sum += squares;
  }
  std::memcpy(&fine, &sum, sizeof(fine));
  std::memcpy(&coarse, reinterpret_cast<const char*>(&sum) + sizeof(fine), sizeof(coarse));
}

}  // namespace sampling

/// Prefetches the texels at the centre of `read`.
TILEFLIGHT_LANE_INLINE void prefetch_texels(const Texture& texture, const TextureRead& read) {
  const float s = sampling::wrap_coordinate(read.s, texture.wrap_s),
              t = sampling::wrap_coordinate(read.t, texture.wrap_t);
  const int level = static_cast<int>(read.lod);
  for (int i = 0; i < 2; ++i) {
    const MipLevel& mip = texture.pyramid->level(std::min(level + i, texture.pyramid->levels() - 1));
    const auto x = static_cast<std::ptrdiff_t>(s * static_cast<float>(mip.width) - 0.5F);
    const auto y = static_cast<std::ptrdiff_t>(t * static_cast<float>(mip.height) - 0.5F);
    const std::uint8_t* texel = mip.texels + 3 * (y * mip.width + x);
    __builtin_prefetch(texel);
    __builtin_prefetch(texel + 3 * static_cast<std::ptrdiff_t>(mip.width));
  }
}

/// Mean of the squared texture values (0..255 squared) for `read`.
TILEFLIGHT_LANE_INLINE Float4 sample_squares(const Texture& texture, TextureRead read) {
  read.s = sampling::wrap_coordinate(read.s, texture.wrap_s);
  read.t = sampling::wrap_coordinate(read.t, texture.wrap_t);
  const int level = static_cast<int>(read.lod);
  const float blend = read.lod - static_cast<float>(level);
  Float4 sum, coarse;
  if (blend > 0.0F) {
    sampling::probes_at_levels(texture, level, read, sum, coarse);
    sum += (coarse - sum) * blend;
  } else {
    sum = sampling::probes_at_level(texture, level, read);
  }
  return sum * (1.0F / static_cast<float>(read.probes));
}

}  // namespace tileflight::render
