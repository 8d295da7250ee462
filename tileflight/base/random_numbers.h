#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <numbers>

namespace tileflight::base {

/// Increment of SplitMix64's counter: 2^64 divided by the golden ratio.
inline constexpr std::uint64_t kSplitMixStep = 0x9E3779B97F4A7C15ULL;

/// Finaliser of SplitMix64 (Steele, Lea, Flood, OOPSLA 2014): 64 well mixed bits of a counter.
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

  /// Uniform integer in [0, n), n below 2^32: high half of a product (Lemire 2019), bias below n / 2^32.
  std::size_t below(std::size_t n) { return static_cast<std::size_t>(((next() >> 32) * n) >> 32); }

 private:
  std::uint64_t state_;
};

/// Key of an independent random stream.
constexpr std::uint64_t stream_key(std::uint64_t seed, std::uint64_t stream) {
  return splitmix64_hash(splitmix64_hash(seed) ^ (stream * 0xD1B54A32D192ED03ULL));
}

/// Four standard normal numbers as a function of key and counter alone (Box and Muller 1958), so that the order of
/// calls does not matter.
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

}  // namespace tileflight::base
