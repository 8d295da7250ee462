#pragma once

#include <charconv>
#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace tileflight::base {

/// Takes the next line off the front of `text` (without its "\n" or "\r\n"); nullopt when nothing is left.
std::optional<std::string_view> take_line(std::string_view& text);

/// Takes the next field off the front of `line`; fields are separated by any of `separators`. Empty when none is left.
std::string_view take_field(std::string_view& line, std::string_view separators = " \t");

/// All fields of a line.
std::vector<std::string_view> split_fields(std::string_view line, std::string_view separators = " \t");

/// A line of a table.
struct TextRow {
  int line;           ///< number in the file, from 1
  std::string where;  ///< file and line, for messages
  std::vector<std::string_view> fields;
};

/// Calls `take` with each line of a file's text that is neither blank nor a comment (its first field begins with '#').
void for_each_row(std::string_view text, const std::string& file, std::string_view separators,
                  const std::function<void(const TextRow& row)>& take);

/// A to Z in lower case; other bytes stay.
std::string to_lower(std::string_view text);

/// A field of a CSV file, quoted where it must be (RFC 4180, section 2, rules 5 to 7).
std::string csv_field(std::string_view plain);

/// Parses all of `field` as a number, independent of the locale; nullopt if it is anything else or out of range. "nan"
/// and "inf" are accepted; callers must check.
template <typename Number>
std::optional<Number> parse_number(std::string_view field) {
  if (field.starts_with('+')) field.remove_prefix(1);
  Number value{};
  const char* end = field.data() + field.size();
  const auto [stop, error] = std::from_chars(field.data(), end, value);
  if (error != std::errc() || stop != end) return std::nullopt;
  return value;
}

/// A field of a table that must be a finite number. Throws InputError, at `where`, if it is not.
double require_finite(const std::string& where, std::string_view field);

/// Appends the shortest decimal text that reads back as exactly `value`, independent of the locale.
template <typename Number>
void append_number(std::string& text, Number value) {
  char digits[32];
  const auto result = std::to_chars(digits, digits + sizeof(digits), value);
  text.append(digits, result.ptr);
}

}  // namespace tileflight::base
