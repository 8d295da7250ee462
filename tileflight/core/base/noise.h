#pragma once

#include <cstdint>

namespace tileflight::base {

/// Mixes the bits of an integer with full avalanche (the finaliser of MurmurHash3); source of all randomness in the
/// built-in site, identical on every machine.
constexpr std::uint32_t murmur3_mix(std::uint32_t h) {
  h ^= h >> 16;
  h *= 0x85ebca6bU;
  h ^= h >> 13;
  h *= 0xc2b2ae35U;
  h ^= h >> 16;
  return h;
}

/// Returns the hash of a lattice point, uniform over 32 bits; cheaper than murmur3_mix, because it is evaluated a
/// billion times.
constexpr std::uint32_t hash_lattice(std::int32_t x, std::int32_t y, std::uint32_t seed) {
  std::uint32_t h = static_cast<std::uint32_t>(x) * 0x9e3779b1U + seed;
  h ^= static_cast<std::uint32_t>(y) * 0x7feb352dU;
  h ^= h >> 15;
  h *= 0x2c1b3c6dU;
  return h ^ (h >> 12);
}

/// Returns the floor as an integer; cheaper than std::floor on processors without an instruction for it.
inline std::int32_t floor_to_int(double x) {
  const auto i = static_cast<std::int32_t>(x);
  return i - (x < i ? 1 : 0);
}

/// Returns a random number, uniform in [0, 1), that is constant over each unit cell of the plane.
inline float cell_random(double x, double y, std::uint32_t seed) {
  return static_cast<float>(hash_lattice(floor_to_int(x), floor_to_int(y), seed) >> 8) * 0x1p-24F;
}

/// Returns value noise in [-1, 1]: random values at integer points, smoothly interpolated with the weight 3t^2 - 2t^3
/// (see Perlin, "Improving noise", SIGGRAPH 2002).
float value_noise(double x, double y, std::uint32_t seed);
float value_noise_3d(double x, double y, double z, std::uint32_t seed);

/// Sums `octaves` of value noise, each at twice the frequency and `gain` times the amplitude of the one before,
/// scaled back to about [-1, 1].
float fractal_noise(double x, double y, std::uint32_t seed, int octaves, float gain = 0.5F);
float fractal_noise_3d(double x, double y, double z, std::uint32_t seed, int octaves, float gain = 0.5F);

/// A random sequence from a seed: the n-th number is the hash of n (counter based), identical on every machine.
class HashRandom {
 public:
  explicit HashRandom(std::uint32_t seed) : seed_(murmur3_mix(seed ^ 0x5bd1e995U)) {}

  std::uint32_t bits() { return murmur3_mix(seed_ + 0x9e3779b1U * ++count_); }
  double uniform() { return bits() * 0x1p-32; }
  double uniform(double low, double high) { return low + (high - low) * uniform(); }
  bool chance(double probability) { return uniform() < probability; }

 private:
  std::uint32_t seed_;
  std::uint32_t count_ = 0;
};

}  // namespace tileflight::base
