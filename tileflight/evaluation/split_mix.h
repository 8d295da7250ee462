#pragma once

#include <cstddef>
#include <cstdint>

namespace tileflight::evaluation {

/// A small generator whose start can be any number (Steele, Lea and Flood, SplitMix64, OOPSLA 2014): one for each
/// resample, so that draws do not depend on the number of threads.
class SplitMix64 {
 public:
  explicit SplitMix64(std::uint64_t seed) : state_(seed) {}

  std::uint64_t next() {
    state_ += 0x9e3779b97f4a7c15ull;
    std::uint64_t z = state_;
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9ull;
    z = (z ^ (z >> 27)) * 0x94d049bb133111ebull;
    return z ^ (z >> 31);
  }

  /// Below n, for n below 2^32: the high half of a product (Lemire 2019), whose bias is below n / 2^32.
  std::size_t below(std::size_t n) { return static_cast<std::size_t>(((next() >> 32) * n) >> 32); }

 private:
  std::uint64_t state_;
};

}  // namespace tileflight::evaluation
