#pragma once

#include <algorithm>
#include <charconv>
#include <string>
#include <vector>

namespace tileflight::base {

/// Quotes a text as one word of a POSIX shell's command line, whatever characters it holds.
inline std::string shell_word(const std::string& text) {
  std::string result = "'";
  for (const char c : text) result += c == '\'' ? "'\\''" : std::string(1, c);
  return result + "'";
}

/// Joins texts with a separator between them: "camera, fps".
inline std::string joined(const std::vector<std::string>& texts, const char* separator = ", ") {
  std::string result;
  for (const std::string& text : texts) result += (result.empty() ? "" : separator) + text;
  return result;
}

/// Appends those texts of `from` that `to` does not have yet.
inline void add_distinct(const std::vector<std::string>& from, std::vector<std::string>& to) {
  for (const std::string& text : from) {
    if (std::find(to.begin(), to.end(), text) == to.end()) to.push_back(text);
  }
}

/// Returns the shortest decimal text without exponent that reads back as exactly `value`.
inline std::string fixed_text(double value) {
  char digits[400];  // the longest double has 325 characters before or after the point
  const auto result = std::to_chars(digits, digits + sizeof digits, value, std::chars_format::fixed);
  return {digits, result.ptr};
}

/// Returns a text with `decimals` digits after the point: the digits of printf("%.*f"), independent of the locale.
inline std::string rounded_text(double value, int decimals) {
  char digits[400];
  const auto result = std::to_chars(digits, digits + sizeof digits, value, std::chars_format::fixed, decimals);
  return {digits, result.ptr};
}

/// Returns rounded_text() without zeros at the end of a fraction.
inline std::string trimmed_text(double value, int decimals) {
  std::string text = rounded_text(value, decimals);
  if (text.find('.') == std::string::npos) return text;
  text.erase(text.find_last_not_of('0') + 1);
  if (text.back() == '.') text.pop_back();
  return text;
}

/// Returns the text that printf would print.
[[gnu::format(printf, 1, 2)]] std::string formatted(const char* format, ...);

}  // namespace tileflight::base
