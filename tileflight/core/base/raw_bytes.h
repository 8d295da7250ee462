#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstring>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace tileflight::base {

/// Views bytes as text; they must outlive the result.
inline std::string_view as_text(std::span<const std::byte> bytes) {
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

/// Reads the number whose bytes stand at `offset`, in this machine's byte order. Precondition: they lie in `bytes`.
template <class Number>
Number read_raw(std::span<const std::byte> bytes, std::size_t offset) {
  Number value;
  std::memcpy(&value, bytes.data() + offset, sizeof value);
  return value;
}

/// Reads the number whose bytes stand at `offset`, the highest first. Precondition: they lie in `bytes`.
template <class Number>
Number read_big_endian(std::span<const std::byte> bytes, std::size_t offset) {
  std::array<std::byte, sizeof(Number)> reversed;
  std::reverse_copy(bytes.begin() + static_cast<std::ptrdiff_t>(offset),
                    bytes.begin() + static_cast<std::ptrdiff_t>(offset + sizeof(Number)), reversed.begin());
  Number value;
  std::memcpy(&value, reversed.data(), sizeof value);
  return value;
}

/// Bytes that belong to a stretch of time: a sample of a video's track.
struct TimedBytes {
  double begin_s = 0.0;
  double duration_s = 0.0;
  std::vector<std::byte> bytes;
};

/// Appends the bytes of a number in this machine's byte order.
template <class Number>
void append_raw(std::string& bytes, const Number& value) {
  bytes.append(reinterpret_cast<const char*>(&value), sizeof value);
}

/// Encodes bytes as Base64 with padding (RFC 4648, section 4).
std::string base64(std::string_view bytes);

}  // namespace tileflight::base
