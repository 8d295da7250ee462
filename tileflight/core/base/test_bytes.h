#pragma once

#include <cstring>
#include <string>

namespace tileflight::base {

/// The bytes of a number in this machine's byte order, for hand-made binary test files.
template <typename T>
std::string to_raw_bytes(T value) {
  std::string bytes(sizeof value, '\0');
  std::memcpy(bytes.data(), &value, sizeof value);
  return bytes;
}

}  // namespace tileflight::base
