#pragma once

#include <cstring>
#include <string>

namespace tileflight::flight {

/// A number as this machine keeps it, for binary files that tests make by hand.
template <typename T>
std::string raw(T value) {
  std::string bytes(sizeof value, '\0');
  std::memcpy(bytes.data(), &value, sizeof value);
  return bytes;
}

}  // namespace tileflight::flight
