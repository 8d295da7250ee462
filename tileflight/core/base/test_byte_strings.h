#pragma once

#include <cstddef>
#include <functional>
#include <string>
#include <vector>

#include "tileflight/core/base/input_error.h"

/// Byte strings for hand-made test files, and checks of the errors they cause.
namespace tileflight::base::test_support {

using Bytes = std::vector<std::byte>;

inline Bytes to_bytes(const std::string& text) {
  const auto* data = reinterpret_cast<const std::byte*>(text.data());
  return {data, data + text.size()};
}

inline std::string to_text(const Bytes& bytes) { return {reinterpret_cast<const char*>(bytes.data()), bytes.size()}; }

/// The bytes of values as stored in a file.
template <class T>
std::string to_raw_bytes(const std::vector<T>& values) {
  return {reinterpret_cast<const char*>(values.data()), values.size() * sizeof(T)};
}

inline std::string error_of(const std::function<void()>& call) {
  try {
    call();
  } catch (const InputError& error) {
    return error.what();
  }
  return "";
}

}  // namespace tileflight::base::test_support
