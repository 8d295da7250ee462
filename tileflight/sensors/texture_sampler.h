#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>

#include "tileflight/imaging/textured_mesh.h"
#include "tileflight/sensors/mip_pyramid.h"

// Filtered texture reads, inlined into the renderer's pixel loop; footprint.h says how many and how coarse.
//
// The weights act on squared values, since squares are near to linear light (sRGB's curve is close to a power of 2) and
// exact where neighbours are equal; mip levels are averaged in exact linear light.
namespace tileflight::sensors {

using Float4 = float __attribute__((vector_size(16)));  // red, green, blue, undefined

/// A texture as the sampler reads it.
struct Texture {
  const MipPyramid* pyramid = nullptr;
  imaging::Wrap wrap_s = imaging::Wrap::kRepeat;
  imaging::Wrap wrap_t = imaging::Wrap::kRepeat;
  float width = 1.0F, height = 1.0F;  ///< of level 0, texels
};

/// Where and how to read: `probes` trilinear reads in a row around (s, t), one (step_s, step_t) apart, at level `lod`.
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

/// A texture coordinate brought to 0..1 by the sampler's rule.
inline float wrapped(float s, imaging::Wrap wrap) {
  if (s >= 0.0F && s <= 1.0F) return s;
  if (wrap == imaging::Wrap::kClampToEdge) return std::clamp(s, 0.0F, 1.0F);
  if (wrap == imaging::Wrap::kRepeat) return s - std::floor(s);
  const float twofold = s - 2.0F * std::floor(0.5F * s);
  return twofold <= 1.0F ? twofold : 2.0F - twofold;
}

/// A texel index near 0..size - 1 brought into it.
inline int wrapped_index(int i, int size, imaging::Wrap wrap) {
  if (i >= 0 && i < size) return i;
  if (wrap == imaging::Wrap::kClampToEdge) return std::clamp(i, 0, size - 1);
  const int period = wrap == imaging::Wrap::kRepeat ? size : 2 * size;
  const int inside = ((i % period) + period) % period;
  return inside < size ? inside : 2 * size - 1 - inside;
}

/// The texel in the low three bytes, as floats. Interleaving with zeros twice widens bytes to integers in two
/// instructions.
inline Float4 unpacked(std::uint64_t bits) {
  using Bytes = std::uint8_t __attribute__((vector_size(16)));
  using Shorts = std::uint16_t __attribute__((vector_size(16)));
  using Words = std::int32_t __attribute__((vector_size(16)));
  using Longs = std::uint64_t __attribute__((vector_size(16)));
  const auto bytes = (Bytes)Longs{bits, 0};
  const auto shorts =
      (Shorts)__builtin_shufflevector(bytes, Bytes{}, 0, 16, 1, 17, 2, 18, 3, 19, 4, 20, 5, 21, 6, 22, 7, 23);
  const auto words = (Words)__builtin_shufflevector(shorts, Shorts{}, 0, 8, 1, 9, 2, 10, 3, 11);
  return __builtin_convertvector(words, Float4);
}

/// Two texels that lie side by side, from one load of eight bytes that never leaves the image.
inline std::uint64_t load_pair(const MipLevel& mip, std::ptrdiff_t texel) {
  const std::uint8_t* address = mip.texels + 3 * texel;
  const std::ptrdiff_t beyond = std::max<std::ptrdiff_t>(0, address - mip.last_load);
  std::uint64_t bits = 0;
  std::memcpy(&bits, address - beyond, sizeof(bits));
  return bits >> (8 * static_cast<unsigned>(beyond));
}

/// Mean of the two squared texels, `f` the share of the second.
inline Float4 mixed_squares(std::uint64_t first, std::uint64_t second, float f) {
  const Float4 a = unpacked(first);
  const Float4 b = unpacked(second);
  return a * a * (1.0F - f) + b * b * f;
}

inline Float4 row_squares(const MipLevel& mip, int x, int y, float f) {
  const std::uint64_t pair = load_pair(mip, static_cast<std::ptrdiff_t>(y) * mip.width + x);
  return mixed_squares(pair, pair >> 24U, f);
}

inline Float4 row_squares(const MipLevel& mip, int x0, int x1, int y, float f) {
  const std::ptrdiff_t row = static_cast<std::ptrdiff_t>(y) * mip.width;
  return mixed_squares(load_pair(mip, row + x0), load_pair(mip, row + x1), f);
}

/// Bilinear mean of squared texels where some of them lie across the image's rim.
inline Float4 bilinear_at_rim(const Texture& texture, const MipLevel& mip, int x0, int y0, float fx, float fy) {
  const int left = wrapped_index(x0, mip.width, texture.wrap_s);
  const int right = wrapped_index(x0 + 1, mip.width, texture.wrap_s);
  const int top = wrapped_index(y0, mip.height, texture.wrap_t);
  const int bottom = wrapped_index(y0 + 1, mip.height, texture.wrap_t);
  return row_squares(mip, left, right, top, fx) * (1.0F - fy) + row_squares(mip, left, right, bottom, fx) * fy;
}

/// Bilinear mean of squared texels; (x, y) in texels, centres at integers.
inline Float4 bilinear_squares(const Texture& texture, const MipLevel& mip, float x, float y) {
  const int x0 = floor_to_int(x);
  const int y0 = floor_to_int(y);
  const float fx = x - static_cast<float>(x0);
  const float fy = y - static_cast<float>(y0);
  const bool inside = x0 >= 0 && y0 >= 0 && x0 + 1 < mip.width && y0 + 1 < mip.height;
  if (!inside) [[unlikely]]
    return bilinear_at_rim(texture, mip, x0, y0, fx, fy);
  return row_squares(mip, x0, y0, fx) * (1.0F - fy) + row_squares(mip, x0, y0 + 1, fx) * fy;
}

/// Sum of the probes' bilinear reads at one level.
inline Float4 probes_at_level(const Texture& texture, int level, const TextureRead& read) {
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

/// Mean of the squared texture values (0..255 squared) that `read` asks for.
inline Float4 sample_squares(const Texture& texture, TextureRead read) {
  read.s = sampling::wrapped(read.s, texture.wrap_s);
  read.t = sampling::wrapped(read.t, texture.wrap_t);
  const int level = static_cast<int>(read.lod);
  const float blend = read.lod - static_cast<float>(level);
  Float4 sum = sampling::probes_at_level(texture, level, read);
  if (blend > 0.0F) sum += (sampling::probes_at_level(texture, level + 1, read) - sum) * blend;
  return sum * (1.0F / static_cast<float>(read.probes));
}

}  // namespace tileflight::sensors
