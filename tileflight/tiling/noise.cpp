#include "tileflight/tiling/noise.h"

namespace tileflight::tiling {
namespace {

float smooth(float t) { return t * t * (3.0F - 2.0F * t); }

/// In [-1, 1).
float lattice_value(std::int32_t x, std::int32_t y, std::uint32_t seed) {
  return static_cast<float>(static_cast<std::int32_t>(hash_lattice(x, y, seed))) * 0x1p-31F;
}

std::uint32_t layer_seed(std::int32_t z, std::uint32_t seed) {
  return mix_bits(seed + static_cast<std::uint32_t>(z) * 0x68e31da4U);
}

}  // namespace

float value_noise(double x, double y, std::uint32_t seed) {
  const std::int32_t ix = floor_to_int(x), iy = floor_to_int(y);
  const float u = smooth(static_cast<float>(x - ix)), v = smooth(static_cast<float>(y - iy));
  const float a = lattice_value(ix, iy, seed), b = lattice_value(ix + 1, iy, seed);
  const float c = lattice_value(ix, iy + 1, seed), d = lattice_value(ix + 1, iy + 1, seed);
  const float low = a + u * (b - a), high = c + u * (d - c);
  return low + v * (high - low);
}

float value_noise(double x, double y, double z, std::uint32_t seed) {
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
    x = 2.0 * x + 17.3;  // off the coarser lattice, so that its lines do not show
    y = 2.0 * y + 5.7;
  }
  return 1.6F * sum / total;
}

float fractal_noise(double x, double y, double z, std::uint32_t seed, int octaves, float gain) {
  float sum = 0.0F, weight = 1.0F, total = 0.0F;
  for (int octave = 0; octave < octaves; ++octave) {
    sum += weight * value_noise(x, y, z, seed + 0x632be5abU * static_cast<std::uint32_t>(octave));
    total += weight;
    weight *= gain;
    x = 2.0 * x + 17.3;
    y = 2.0 * y + 5.7;
    z = 2.0 * z + 11.1;
  }
  return 1.6F * sum / total;
}

}  // namespace tileflight::tiling
