#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>

#include "tileflight/base/simd.h"
#include "tileflight/imaging/textured_mesh.h"
#include "tileflight/render/mip_pyramid.h"

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

/// Unpacks the low three bytes of two words to floats: the first word's texel to elements 0 to 2, the second's to 4 to
/// 6.
TILEFLIGHT_LANE_INLINE void unpack(std::uint64_t first, std::uint64_t second, Float8& texels) {
  using Bytes = std::uint8_t __attribute__((vector_size(16)));
  using Shorts = std::uint16_t __attribute__((vector_size(16)));
  using Longs = std::uint64_t __attribute__((vector_size(16)));
  const auto bytes = (Bytes)Longs{(first & 0xFFFFFFFFU) | (second << 32U), 0};
  const auto shorts =
      (Shorts)__builtin_shufflevector(bytes, Bytes{}, 0, 16, 1, 17, 2, 18, 3, 19, 4, 20, 5, 21, 6, 22, 7, 23);
  texels = __builtin_convertvector(__builtin_convertvector(shorts, base::Int8), Float8);
}

/// Bilinear mean of four squared texels: the `left` and `right` ones of the upper (0) and the lower row (1).
TILEFLIGHT_LANE_INLINE Float4 interpolate_squares(const std::uint64_t (&left)[2], const std::uint64_t (&right)[2],
                                                  float fx, float fy) {
  Float8 a, b;
  unpack(left[0], left[1], a);
  unpack(right[0], right[1], b);
  const Float8 rows = a * a * (1.0F - fx) + b * b * fx;
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
  const auto texel = [&](int x, int y) { return load_pair(mip, static_cast<std::ptrdiff_t>(y) * mip.width + x); };
  return interpolate_squares({texel(left, top), texel(left, bottom)}, {texel(right, top), texel(right, bottom)}, fx,
                             fy);
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
  return interpolate_squares(pairs, {pairs[0] >> 24U, pairs[1] >> 24U}, fx, fy);
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
  Float4 sum = sampling::probes_at_level(texture, level, read);
  if (blend > 0.0F) sum += (sampling::probes_at_level(texture, level + 1, read) - sum) * blend;
  return sum * (1.0F / static_cast<float>(read.probes));
}

}  // namespace tileflight::render
