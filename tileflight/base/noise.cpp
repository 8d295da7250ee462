#include "tileflight/base/noise.h"

#include "tileflight/base/simd.h"

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

float fractal_noise(double x, double y, std::uint32_t seed, int octaves, float gain) {
  float sum = 0.0F, weight = 1.0F, total = 0.0F;
  for (int octave = 0; octave < octaves; ++octave) {
    sum += weight * value_noise(x, y, seed + 0x632be5abU * static_cast<std::uint32_t>(octave));
    total += weight;
    weight *= gain;
    x = 2.0 * x + 17.3;  // offset from the coarser lattice, so that lattice lines do not coincide
    y = 2.0 * y + 5.7;
  }
  return 1.6F * sum / total;
}

float fractal_noise_3d(double x, double y, double z, std::uint32_t seed, int octaves, float gain) {
  float sum = 0.0F, weight = 1.0F, total = 0.0F;
  for (int octave = 0; octave < octaves; ++octave) {
    sum += weight * value_noise_3d(x, y, z, seed + 0x632be5abU * static_cast<std::uint32_t>(octave));
    total += weight;
    weight *= gain;
    x = 2.0 * x + 17.3;
    y = 2.0 * y + 5.7;
    z = 2.0 * z + 11.1;
  }
  return 1.6F * sum / total;
}

}  // namespace tileflight::base
