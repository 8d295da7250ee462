#include "tileflight/core/base/raw_bytes.h"

#include <cstdint>

namespace tileflight::base {

std::string base64(std::string_view bytes) {
  constexpr std::string_view kAlphabet = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string result;
  result.reserve(bytes.size() / 3 * 4 + 4);
  const auto byte = [&](std::size_t i) {
    return i < bytes.size() ? std::uint32_t{static_cast<unsigned char>(bytes[i])} : 0u;
  };
  for (std::size_t i = 0; i < bytes.size(); i += 3) {
    const std::uint32_t group = byte(i) << 16 | byte(i + 1) << 8 | byte(i + 2);
    result += kAlphabet[group >> 18];
    result += kAlphabet[group >> 12 & 63];
    result += i + 1 < bytes.size() ? kAlphabet[group >> 6 & 63] : '=';
    result += i + 2 < bytes.size() ? kAlphabet[group & 63] : '=';
  }
  return result;
}

}  // namespace tileflight::base
