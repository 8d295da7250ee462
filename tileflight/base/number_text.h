#pragma once

#include <charconv>
#include <string>

namespace tileflight::base {

/// Shortest decimal text without exponent that reads back as exactly `value`.
inline std::string fixed_text(double value) {
  char digits[400];  // the longest double has 325 characters before or after the point
  const auto result = std::to_chars(digits, digits + sizeof digits, value, std::chars_format::fixed);
  return {digits, result.ptr};
}

/// Text with `decimals` digits after the point, for messages.
inline std::string rounded_text(double value, int decimals) {
  char digits[400];
  const auto result = std::to_chars(digits, digits + sizeof digits, value, std::chars_format::fixed, decimals);
  return {digits, result.ptr};
}

}  // namespace tileflight::base
