#pragma once

#include <cstdint>

namespace tileflight::tiling {

/// Integer mixing with full avalanche (the finaliser of MurmurHash3); the source of all chance in the built-in place,
/// so that it is the same on every machine.
constexpr std::uint32_t mix_bits(std::uint32_t h) {
  h ^= h >> 16;
  h *= 0x85ebca6bU;
  h ^= h >> 13;
  h *= 0xc2b2ae35U;
  h ^= h >> 16;
  return h;
}

/// Hash of a lattice point, uniform over 32 bits; lighter than mix_bits, for it is drawn a billion times.
constexpr std::uint32_t hash_lattice(std::int32_t x, std::int32_t y, std::uint32_t seed) {
  std::uint32_t h = static_cast<std::uint32_t>(x) * 0x9e3779b1U + seed;
  h ^= static_cast<std::uint32_t>(y) * 0x7feb352dU;
  h ^= h >> 15;
  h *= 0x2c1b3c6dU;
  return h ^ (h >> 12);
}

/// The integer below; cheaper than std::floor where there is no instruction for it.
inline std::int32_t floor_to_int(double x) {
  const auto i = static_cast<std::int32_t>(x);
  return i - (x < i ? 1 : 0);
}

/// Uniform in [0, 1), constant over each unit cell of the plane.
inline float cell_random(double x, double y, std::uint32_t seed) {
  return static_cast<float>(hash_lattice(floor_to_int(x), floor_to_int(y), seed) >> 8) * 0x1p-24F;
}

/// Value noise in [-1, 1]: random values at integer points, smooth between (Perlin, "Improving noise", SIGGRAPH 2002,
/// for the weight 3t^2 - 2t^3's role).
float value_noise(double x, double y, std::uint32_t seed);
float value_noise_3d(double x, double y, double z, std::uint32_t seed);

/// Sum of `octaves` of value noise, each twice as fine and `gain` times as strong, scaled back to about [-1, 1].
float fractal_noise(double x, double y, std::uint32_t seed, int octaves, float gain = 0.5F);
float fractal_noise_3d(double x, double y, double z, std::uint32_t seed, int octaves, float gain = 0.5F);

/// A sequence of random numbers from a seed: the n-th is the hash of n (counter based), equal everywhere.
class Random {
 public:
  explicit Random(std::uint32_t seed) : seed_(mix_bits(seed ^ 0x5bd1e995U)) {}

  std::uint32_t bits() { return mix_bits(seed_ + 0x9e3779b1U * ++count_); }
  double uniform() { return bits() * 0x1p-32; }
  double uniform(double low, double high) { return low + (high - low) * uniform(); }
  bool chance(double probability) { return uniform() < probability; }

 private:
  std::uint32_t seed_;
  std::uint32_t count_ = 0;
};

}  // namespace tileflight::tiling
