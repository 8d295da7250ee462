#pragma once

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <cstring>

#include "tileflight/imaging/textured_mesh.h"
#include "tileflight/sensors/mip_pyramid.h"

// Filtered texture reads, inlined into the renderer's pixel loop.
//
// Notation: (s, t) texture coordinates, 0..1 over the image, origin at its top left corner. The footprint of a pixel in
// texels of level 0 is the parallelogram of the columns of J = d(texel) / d(pixel), as long and wide as the singular
// values sigma_1 >= sigma_2 of J. About sigma_1 / sigma_2 probes (at most kMaxProbes) lie evenly along the long axis,
// each trilinear at the level whose texel is max(sigma_1 / probes, sigma_2) wide: McCormack et al., "Feline: fast
// elliptical lines for anisotropic texture mapping", SIGGRAPH 1999.
//
// The weights act on squared values, since squares are near to linear light (sRGB's curve is close to a power of 2) and
// exact where neighbours are equal; mip levels are averaged in exact linear light.
namespace tileflight::sensors {

constexpr int kMaxProbes = 8;

using Float4 = float __attribute__((vector_size(16)));  // red, green, blue, unused

/// A texture as the sampler reads it.
struct Texture {
  const MipPyramid* pyramid = nullptr;
  imaging::Wrap wrap_s = imaging::Wrap::kRepeat;
  imaging::Wrap wrap_t = imaging::Wrap::kRepeat;
  float width = 0.0F, height = 0.0F;  ///< of level 0, texels
};

/// Columns of J: the move in texels of level 0 from this pixel to the next to the right (x) and below (y).
struct TexelGradient {
  float s_x = 0.0F, t_x = 0.0F, s_y = 0.0F, t_y = 0.0F;
};

/// Where and how to read: `probes` reads, stepping by (step_s, step_t), each at level `level` + `blend`.
struct Footprint {
  int probes = 1;
  float step_s = 0.0F, step_t = 0.0F;  ///< texture coordinates
  int level = 0;
  float blend = 0.0F;  ///< share of level + 1
};

namespace sampling {

/// Log2 by exponent and a linear mantissa: exact at powers of two, continuous, 0.09 off between. For x > 0.
inline float coarse_log2(float x) {
  const auto bits = std::bit_cast<std::uint32_t>(x);
  const float mantissa = std::bit_cast<float>((bits & 0x007FFFFFU) | 0x3F800000U);
  return static_cast<float>(static_cast<int>(bits >> 23U) - 127) + (mantissa - 1.0F);
}

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

inline Float4 unpacked(std::uint32_t texel) {
  return Float4{static_cast<float>(texel & 0xFFU), static_cast<float>((texel >> 8U) & 0xFFU),
                static_cast<float>((texel >> 16U) & 0xFFU), 0.0F};
}

/// Two texels that lie side by side, from one load of eight bytes that never leaves the image.
inline std::uint64_t load_pair(const MipLevel& mip, std::ptrdiff_t texel) {
  const std::uint8_t* address = mip.texels + 3 * texel;
  const std::ptrdiff_t beyond = std::max<std::ptrdiff_t>(0, address - mip.last_load);
  std::uint64_t bits = 0;
  std::memcpy(&bits, address - beyond, sizeof(bits));
  return bits >> (8 * static_cast<unsigned>(beyond));
}

inline std::uint32_t load_one(const MipLevel& mip, std::ptrdiff_t texel) {
  return static_cast<std::uint32_t>(load_pair(mip, texel)) & 0xFFFFFFU;
}

/// Mean of the two squared texels, `f` the share of the second.
inline Float4 mixed_squares(std::uint32_t first, std::uint32_t second, float f) {
  const Float4 a = unpacked(first);
  const Float4 b = unpacked(second);
  return a * a * (1.0F - f) + b * b * f;
}

inline Float4 row_squares(const MipLevel& mip, int x, int y, float f) {
  const std::uint64_t pair = load_pair(mip, static_cast<std::ptrdiff_t>(y) * mip.width + x);
  return mixed_squares(static_cast<std::uint32_t>(pair), static_cast<std::uint32_t>(pair >> 24U), f);
}

inline Float4 row_squares_wrapped(const MipLevel& mip, int x0, int x1, int y, float f) {
  const std::ptrdiff_t row = static_cast<std::ptrdiff_t>(y) * mip.width;
  return mixed_squares(load_one(mip, row + x0), load_one(mip, row + x1), f);
}

/// Bilinear mean of squared texels at (s, t); texel centres at half-integers of s * width.
inline Float4 bilinear_squares(const Texture& texture, int level, float s, float t) {
  const MipLevel& mip = texture.pyramid->level(level);
  const float x = s * static_cast<float>(mip.width) - 0.5F;
  const float y = t * static_cast<float>(mip.height) - 0.5F;
  const int x0 = floor_to_int(x);
  const int y0 = floor_to_int(y);
  const float fx = x - static_cast<float>(x0);
  const float fy = y - static_cast<float>(y0);
  const bool inside = x0 >= 0 && y0 >= 0 && x0 + 1 < mip.width && y0 + 1 < mip.height;
  if (inside) {
    return row_squares(mip, x0, y0, fx) * (1.0F - fy) + row_squares(mip, x0, y0 + 1, fx) * fy;
  }
  const int left = wrapped_index(x0, mip.width, texture.wrap_s);
  const int right = wrapped_index(x0 + 1, mip.width, texture.wrap_s);
  const int top = wrapped_index(y0, mip.height, texture.wrap_t);
  const int bottom = wrapped_index(y0 + 1, mip.height, texture.wrap_t);
  return row_squares_wrapped(mip, left, right, top, fx) * (1.0F - fy) +
         row_squares_wrapped(mip, left, right, bottom, fx) * fy;
}

}  // namespace sampling

/// How to read the texture over a pixel's footprint; no level above `max_level`.
inline Footprint footprint_of(const Texture& texture, const TexelGradient& g, int max_level) {
  const float m_ss = g.s_x * g.s_x + g.s_y * g.s_y;  // J J^T
  const float m_tt = g.t_x * g.t_x + g.t_y * g.t_y;
  const float m_st = g.s_x * g.t_x + g.s_y * g.t_y;
  const float half_trace = 0.5F * (m_ss + m_tt);
  const float largest = texture.width * texture.width + texture.height * texture.height;
  if (!(half_trace < largest)) return {.level = max_level};  // more than the whole image, or not a number
  const float half_difference = 0.5F * (m_ss - m_tt);
  const float root = std::sqrt(half_difference * half_difference + m_st * m_st);
  const float lambda_1 = half_trace + root;
  Footprint result;
  if (lambda_1 <= 1.0F) return result;
  const float lambda_2 = std::max(half_trace - root, 1.0F);  // no need for probes closer than texels
  const float ratio = std::sqrt(lambda_1 / lambda_2);
  result.probes = std::min(kMaxProbes, static_cast<int>(ratio + 0.7F));
  const auto probes = static_cast<float>(result.probes);
  const float lod = 0.5F * sampling::coarse_log2(std::max(lambda_1 / (probes * probes), lambda_2));
  if (lod >= static_cast<float>(max_level)) {
    result.level = max_level;
  } else if (lod > 0.0F) {
    result.level = static_cast<int>(lod);
    result.blend = lod - static_cast<float>(result.level);
  }
  if (result.probes > 1) {
    // Eigenvector of lambda_1, from the better conditioned row of (J J^T - lambda_1 I).
    float axis_s = half_difference >= 0.0F ? half_difference + root : m_st;
    float axis_t = half_difference >= 0.0F ? m_st : root - half_difference;
    const float length = std::sqrt(axis_s * axis_s + axis_t * axis_t);
    const float step = std::sqrt(lambda_1) / (probes * std::max(length, 1e-30F));
    axis_s *= step;
    axis_t *= step;
    result.step_s = axis_s / texture.width;
    result.step_t = axis_t / texture.height;
  }
  return result;
}

/// Mean of the squared texture values (0..255 squared) over the footprint.
inline Float4 sample_squares(const Texture& texture, float s, float t, const Footprint& footprint) {
  const float first = -0.5F * static_cast<float>(footprint.probes - 1);
  float probe_s = sampling::wrapped(s, texture.wrap_s) + first * footprint.step_s;
  float probe_t = sampling::wrapped(t, texture.wrap_t) + first * footprint.step_t;
  Float4 sum{};
  for (int i = 0; i < footprint.probes; ++i) {
    sum += sampling::bilinear_squares(texture, footprint.level, probe_s, probe_t) * (1.0F - footprint.blend);
    if (footprint.blend > 0.0F) {
      sum += sampling::bilinear_squares(texture, footprint.level + 1, probe_s, probe_t) * footprint.blend;
    }
    probe_s += footprint.step_s;
    probe_t += footprint.step_t;
  }
  return sum * (1.0F / static_cast<float>(footprint.probes));
}

}  // namespace tileflight::sensors
