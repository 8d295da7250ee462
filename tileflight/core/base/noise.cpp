#include "tileflight/core/base/noise.h"

#include <algorithm>
#include <array>

#include "tileflight/core/base/simd.h"

namespace tileflight::base {
namespace {

float smooth(float t) { return t * t * (3.0F - 2.0F * t); }

/// The corners of a lattice cell are hashed in parallel.
using Bits4 = std::uint32_t __attribute__((vector_size(16)));

/// hash_lattice at (x, y), (x + 1, y), (x, y + 1), (x + 1, y + 1), as numbers in [-1, 1).
Float4 corner_values(std::int32_t x, std::int32_t y, std::uint32_t seed) {
  const std::uint32_t x0 = static_cast<std::uint32_t>(x) * 0x9e3779b1U + seed, x1 = x0 + 0x9e3779b1U;
  const std::uint32_t y0 = static_cast<std::uint32_t>(y) * 0x7feb352dU, y1 = y0 + 0x7feb352dU;
  Bits4 h{x0 ^ y0, x1 ^ y0, x0 ^ y1, x1 ^ y1};
  h ^= h >> 15;
  h *= 0x2c1b3c6dU;
  h ^= h >> 12;
  return __builtin_convertvector(reinterpret_cast<Int4>(h), Float4) * 0x1p-31F;
}

TILEFLIGHT_LANE_INLINE void floor_of(const Double4& x, Int4& floor) {
  floor = __builtin_convertvector(x, Int4);
  const Double4 back = __builtin_convertvector(floor, Double4);
  floor += __builtin_convertvector(x < back, Int4);
}

TILEFLIGHT_LANE_INLINE void corner_value(const Bits4& hashed_x, const Bits4& hashed_y, Float4& value) {
  Bits4 h = hashed_x ^ hashed_y;
  h ^= h >> 15;
  h *= 0x2c1b3c6dU;
  h ^= h >> 12;
  value = __builtin_convertvector(reinterpret_cast<Int4>(h), Float4) * 0x1p-31F;
}

/// value_noise() at four points, each with a seed of its own.
TILEFLIGHT_LANE_INLINE void lattice_noise(const Double4& x, const Double4& y, const Bits4& seeds, Float4& values) {
  Int4 ix, iy;
  floor_of(x, ix);
  floor_of(y, iy);
  const Float4 s = __builtin_convertvector(x - __builtin_convertvector(ix, Double4), Float4);
  const Float4 t = __builtin_convertvector(y - __builtin_convertvector(iy, Double4), Float4);
  const Float4 u = s * s * (3.0F - 2.0F * s), v = t * t * (3.0F - 2.0F * t);
  const Bits4 x0 = reinterpret_cast<Bits4>(ix) * 0x9e3779b1U + seeds, x1 = x0 + 0x9e3779b1U;
  const Bits4 y0 = reinterpret_cast<Bits4>(iy) * 0x7feb352dU, y1 = y0 + 0x7feb352dU;
  Float4 at00, at10, at01, at11;
  corner_value(x0, y0, at00);
  corner_value(x1, y0, at10);
  corner_value(x0, y1, at01);
  corner_value(x1, y1, at11);
  const Float4 low = at00 + u * (at10 - at00), high = at01 + u * (at11 - at01);
  values = low + v * (high - low);
}

std::uint32_t layer_seed(std::int32_t z, std::uint32_t seed) {
  return murmur3_mix(seed + static_cast<std::uint32_t>(z) * 0x68e31da4U);
}

}  // namespace

float value_noise(double x, double y, std::uint32_t seed) {
  const std::int32_t ix = floor_to_int(x), iy = floor_to_int(y);
  const float u = smooth(static_cast<float>(x - ix)), v = smooth(static_cast<float>(y - iy));
  const Float4 at = corner_values(ix, iy, seed);
  const float low = at[0] + u * (at[1] - at[0]), high = at[2] + u * (at[3] - at[2]);
  return low + v * (high - low);
}

float value_noise_3d(double x, double y, double z, std::uint32_t seed) {
  const std::int32_t iz = floor_to_int(z);
  const float w = smooth(static_cast<float>(z - iz));
  const float low = value_noise(x, y, layer_seed(iz, seed)), high = value_noise(x, y, layer_seed(iz + 1, seed));
  return low + w * (high - low);
}

/// Octaves are independent of each other: four at once, an octave a lane, each as value_noise() gives it.
TILEFLIGHT_WIDE_VECTORS
float fractal_noise(double x, double y, std::uint32_t seed, int octaves, float gain) {
  constexpr int kTogether = 4;
  float sum = 0.0F, weight = 1.0F, total = 0.0F;
  for (int first = 0; first < octaves; first += kTogether) {
    Double4 xs, ys;
    Bits4 seeds;
    for (int lane = 0; lane < kTogether; ++lane) {
      xs[lane] = x;
      ys[lane] = y;
      seeds[lane] = seed + 0x632be5abU * static_cast<std::uint32_t>(first + lane);
      x = 2.0 * x + 17.3;  // offset from the coarser lattice, so that lattice lines do not coincide
      y = 2.0 * y + 5.7;
    }
    Float4 values;
    lattice_noise(xs, ys, seeds, values);
    for (int lane = 0; lane < std::min(kTogether, octaves - first); ++lane) {
      sum += weight * values[lane];
      total += weight;
      weight *= gain;
    }
  }
  return 1.6F * sum / total;
}

/// Two octaves at once, each in the layers below and above.
TILEFLIGHT_WIDE_VECTORS
float fractal_noise_3d(double x, double y, double z, std::uint32_t seed, int octaves, float gain) {
  constexpr int kTogether = 2;
  float sum = 0.0F, weight = 1.0F, total = 0.0F;
  for (int first = 0; first < octaves; first += kTogether) {
    Double4 xs, ys;
    Bits4 seeds;
    std::array<float, kTogether> above{};
    for (int octave = 0; octave < kTogether; ++octave) {
      const std::uint32_t own = seed + 0x632be5abU * static_cast<std::uint32_t>(first + octave);
      const std::int32_t iz = floor_to_int(z);
      above[static_cast<std::size_t>(octave)] = smooth(static_cast<float>(z - iz));
      for (int layer = 0; layer < 2; ++layer) {
        xs[2 * octave + layer] = x;
        ys[2 * octave + layer] = y;
        seeds[2 * octave + layer] = layer_seed(iz + layer, own);
      }
      x = 2.0 * x + 17.3;
      y = 2.0 * y + 5.7;
      z = 2.0 * z + 11.1;
    }
    Float4 values;
    lattice_noise(xs, ys, seeds, values);
    for (int octave = 0; octave < std::min(kTogether, octaves - first); ++octave) {
      const float low = values[2 * octave], high = values[2 * octave + 1];
      sum += weight * (low + above[static_cast<std::size_t>(octave)] * (high - low));
      total += weight;
      weight *= gain;
    }
  }
  return 1.6F * sum / total;
}

}  // namespace tileflight::base
