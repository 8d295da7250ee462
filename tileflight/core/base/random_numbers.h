#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <numbers>

#include "tileflight/core/base/simd.h"

namespace tileflight::base {

/// Increment of SplitMix64's counter: 2^64 divided by the golden ratio.
inline constexpr std::uint64_t kSplitMixStep = 0x9E3779B97F4A7C15ULL;

/// Hashes a counter by the finaliser of SplitMix64 (Steele, Lea, Flood, OOPSLA 2014): 64 well mixed bits.
constexpr std::uint64_t splitmix64_hash(std::uint64_t x) {
  x += kSplitMixStep;
  x = (x ^ (x >> 30U)) * 0xBF58476D1CE4E5B9ULL;
  x = (x ^ (x >> 27U)) * 0x94D049BB133111EBULL;
  return x ^ (x >> 31U);
}

/// A small generator that accepts any seed (Steele, Lea and Flood, SplitMix64, OOPSLA 2014): one for each resample, so
/// that draws do not depend on the number of threads.
class SplitMix64 {
 public:
  explicit SplitMix64(std::uint64_t seed) : state_(seed) {}

  std::uint64_t next() {
    const std::uint64_t bits = splitmix64_hash(state_);
    state_ += kSplitMixStep;
    return bits;
  }

  /// Draws a uniform integer in [0, n), n below 2^32: high half of a product (Lemire 2019), bias below n / 2^32.
  std::size_t below(std::size_t n) { return static_cast<std::size_t>(((next() >> 32) * n) >> 32); }

 private:
  std::uint64_t state_;
};

/// Returns the key of an independent random stream.
constexpr std::uint64_t stream_key(std::uint64_t seed, std::uint64_t stream) {
  return splitmix64_hash(splitmix64_hash(seed) ^ (stream * 0xD1B54A32D192ED03ULL));
}

/// Returns four standard normal numbers as a function of key and counter alone (Box and Muller 1958), so that the order
/// of calls does not matter.
inline std::array<float, 4> normal_variates(std::uint64_t key, std::uint64_t counter) {
  std::array<float, 4> normal;
  for (std::size_t pair = 0; pair < 2; ++pair) {
    const std::uint64_t bits = splitmix64_hash(key ^ splitmix64_hash(2 * counter + pair));
    const float uniform = static_cast<float>((bits >> 40U) + 1U) * 0x1p-24F;  // (0, 1]
    const float angle = static_cast<float>((bits & 0xFFFFFFU)) * (0x1p-24F * 2.0F * std::numbers::pi_v<float>);
    const float radius = std::sqrt(-2.0F * std::log(uniform));
    normal[2 * pair] = radius * std::cos(angle);
    normal[2 * pair + 1] = radius * std::sin(angle);
  }
  return normal;
}

/// Computes the natural logarithms of eight normal floats above 0, to 2e-7 of the larger of 1 and the value: x = 2^e m
/// with m from sqrt(1/2) to sqrt(2), and ln m = 2 artanh((m - 1) / (m + 1)).
TILEFLIGHT_LANE_INLINE void logarithm(const Float8& x, Float8& out) {
  constexpr std::int32_t kRootOfHalf = 0x3F3504F3;  // the bits of sqrt(1/2)
  Int8 bits;
  std::memcpy(&bits, &x, sizeof(bits));
  const Int8 exponent = (bits - kRootOfHalf) >> 23;
  bits -= exponent << 23;
  Float8 m;
  std::memcpy(&m, &bits, sizeof(m));
  const Float8 s = (m - 1.0F) / (m + 1.0F), z = s * s;
  const Float8 series = z * (1.0F / 3 + z * (1.0F / 5 + z * (1.0F / 7 + z * (1.0F / 9))));
  out = __builtin_convertvector(exponent, Float8) * std::numbers::ln2_v<float> + 2.0F * (s + s * series);
}

/// Computes the cosine and sine of eight angles, given in 2^-24 of a turn from 0 on, to 2e-7: Taylor's series within an
/// eighth of a turn about the nearest quarter.
TILEFLIGHT_LANE_INLINE void cosine_and_sine(const Int8& angle, Float8& cosine, Float8& sine) {
  const Int8 quarter = (angle + (1 << 21)) >> 22;
  const Float8 x = __builtin_convertvector(angle - (quarter << 22), Float8) * (0x1p-23F * std::numbers::pi_v<float>);
  const Float8 z = x * x;
  const Float8 s = x + x * z * (-1.0F / 6 + z * (1.0F / 120 + z * (-1.0F / 5040 + z * (1.0F / 362880))));
  const Float8 c = 1.0F + z * (-0.5F + z * (1.0F / 24 + z * (-1.0F / 720 + z * (1.0F / 40320))));
  const Mask8 is_odd = (quarter & 1) != 0;
  const Float8 along = is_odd ? s : c, across = is_odd ? c : s;
  cosine = ((quarter + 1) & 2) != 0 ? -along : along;
  sine = (quarter & 2) != 0 ? -across : across;
}

/// Computes normal_variates() for eight successive counters: normals[i][k] is the i-th number of counter `first` + k.
/// The results differ from normal_variates() by at most 4e-6, and have the same bits on every processor, since no
/// function of the C library is involved.
TILEFLIGHT_LANE_INLINE void normal_variates8(std::uint64_t key, std::uint64_t first, std::array<Float8, 4>& normals) {
  for (std::size_t pair = 0; pair < 2; ++pair) {
    std::array<std::int32_t, kLanes> high, low;
    for (std::size_t k = 0; k < high.size(); ++k) {
      const std::uint64_t bits = splitmix64_hash(key ^ splitmix64_hash(2 * (first + k) + pair));
      high[k] = static_cast<std::int32_t>(bits >> 40U) + 1;
      low[k] = static_cast<std::int32_t>(bits & 0xFFFFFFU);
    }
    Int8 uniform_bits, angle;
    std::memcpy(&uniform_bits, high.data(), sizeof(uniform_bits));
    std::memcpy(&angle, low.data(), sizeof(angle));
    Float8 radius, cosine, sine;
    logarithm(__builtin_convertvector(uniform_bits, Float8) * 0x1p-24F, radius);
    radius *= -2.0F;
    square_root(radius, radius);
    cosine_and_sine(angle, cosine, sine);
    normals[2 * pair] = radius * cosine;
    normals[2 * pair + 1] = radius * sine;
  }
}

}  // namespace tileflight::base
