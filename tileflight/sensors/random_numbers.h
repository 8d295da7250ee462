#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <numbers>

namespace tileflight::sensors {

/// Finaliser of SplitMix64 (Steele, Lea, Flood, OOPSLA 2014): 64 well mixed bits of a counter.
constexpr std::uint64_t mixed_bits(std::uint64_t x) {
  x += 0x9E3779B97F4A7C15ULL;
  x = (x ^ (x >> 30U)) * 0xBF58476D1CE4E5B9ULL;
  x = (x ^ (x >> 27U)) * 0x94D049BB133111EBULL;
  return x ^ (x >> 31U);
}

/// A key for a stream of its own.
constexpr std::uint64_t stream_key(std::uint64_t seed, std::uint64_t stream) {
  return mixed_bits(mixed_bits(seed) ^ (stream * 0xD1B54A32D192ED03ULL));
}

/// Four standard normal numbers as a function of key and counter alone (Box and Muller 1958), so that it does not
/// matter who asks when.
inline std::array<float, 4> normal_numbers(std::uint64_t key, std::uint64_t counter) {
  std::array<float, 4> normal;
  for (std::size_t pair = 0; pair < 2; ++pair) {
    const std::uint64_t bits = mixed_bits(key ^ mixed_bits(2 * counter + pair));
    const float uniform = static_cast<float>((bits >> 40U) + 1U) * 0x1p-24F;  // (0, 1]
    const float angle = static_cast<float>((bits & 0xFFFFFFU)) * (0x1p-24F * 2.0F * std::numbers::pi_v<float>);
    const float radius = std::sqrt(-2.0F * std::log(uniform));
    normal[2 * pair] = radius * std::cos(angle);
    normal[2 * pair + 1] = radius * std::sin(angle);
  }
  return normal;
}

}  // namespace tileflight::sensors
