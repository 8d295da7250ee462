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

/// Text with `decimals` digits after the point; the digits of printf("%.*f"), independent of the locale.
inline std::string rounded_text(double value, int decimals) {
  char digits[400];
  const auto result = std::to_chars(digits, digits + sizeof digits, value, std::chars_format::fixed, decimals);
  return {digits, result.ptr};
}

/// As rounded_text, without zeros at the end of a fraction.
inline std::string trimmed_text(double value, int decimals) {
  std::string text = rounded_text(value, decimals);
  if (text.find('.') == std::string::npos) return text;
  text.erase(text.find_last_not_of('0') + 1);
  if (text.back() == '.') text.pop_back();
  return text;
}

/// The text that printf would print.
[[gnu::format(printf, 1, 2)]] std::string formatted(const char* format, ...);

}  // namespace tileflight::base
