#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <string_view>

namespace tileflight::geometry {

/// SHA-256 (FIPS 180-4) of bytes that come one part after the other.
class Sha256 {
 public:
  void add(std::string_view bytes);
  /// Of all that was added so far, lower-case hexadecimal.
  std::string hex() const;

 private:
  std::array<std::uint32_t, 8> state_ = {0x6a09e667, 0xbb67ae85, 0x3c6ef372, 0xa54ff53a,
                                         0x510e527f, 0x9b05688c, 0x1f83d9ab, 0x5be0cd19};
  std::string rest_;  ///< of the last block, which is not whole
  std::uint64_t bytes_ = 0;
};

}  // namespace tileflight::geometry
