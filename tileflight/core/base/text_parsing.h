#pragma once

#include <charconv>
#include <cstdint>
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

/// Splits a line into all of its fields.
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

/// Converts A to Z to lower case; other bytes stay.
std::string to_lower(std::string_view text);

/// Returns a text as a field of a CSV file, quoted where it must be (RFC 4180, section 2, rules 5 to 7).
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

/// Parses a field of a table as a finite number. Throws InputError, at `where`, if it is none.
double require_finite(const std::string& where, std::string_view field);

/// Appends the shortest decimal text that reads back as exactly `value`, independent of the locale.
template <typename Number>
void append_number(std::string& text, Number value) {
  char digits[32];
  const auto result = std::to_chars(digits, digits + sizeof(digits), value);
  text.append(digits, result.ptr);
}

/// Text logs larger than this are refused: an hour of 60 Hz subtitles is about 60 MB.
inline constexpr std::uintmax_t kMaxLogBytes = std::uintmax_t{1} << 30;

bool is_digit(char c);

/// Removes blanks, tabs and line ends at both ends of a text.
std::string_view trim(std::string_view text);

/// Removes a leading UTF-8 byte order mark.
std::string_view strip_byte_order_mark(std::string_view text);

/// Removes `expected` from the front of `text` if it is there; returns whether it was.
bool take_prefix(std::string_view& text, std::string_view expected);

/// Takes a finite number from the front (leading spaces and '+' are skipped); nullopt, with `text` unchanged, if there
/// is none.
std::optional<double> take_number(std::string_view& text);

/// Parses the whole text, apart from surrounding blanks, as one finite number.
std::optional<double> parse_finite_number(std::string_view text);

/// Parses as parse_finite_number(), also with a decimal comma ("47,0001"). For fields of formats in which a comma
/// cannot separate numbers.
std::optional<double> parse_decimal_number(std::string_view text);

/// Parses the whole text, apart from surrounding blanks, as an angle in degrees: a number as parse_decimal_number(),
/// with or without a degree sign and a hemisphere ("8.46", "8.46 deg S", "8.46S"), or degrees, minutes and seconds with
/// a hemisphere as ExifTool writes them (`8 deg 27' 55.22" S`). S and W are negative. nullopt for anything else.
std::optional<double> parse_angle_deg(std::string_view text);

/// The unit of times in a file that states none.
struct TimeUnit {
  double seconds = 1.0;
  const char* name = "seconds";
};

/// Tells the unit by the first time of a file: seconds, unless it would then be a date after the year 5000; else a date
/// of this century in milliseconds, microseconds or nanoseconds.
TimeUnit guess_time_unit(double first_time);

/// Takes the digits at the front (nine at most) as an integer, for dates and time stamps ("08" is 8).
std::optional<int> take_digits(std::string_view& text);

/// Takes HH:MM:SS with optional milliseconds after a comma or a point; returns seconds.
std::optional<double> take_clock(std::string_view& text);

/// Takes `2017.08.05`, `2017-08-05`, `2017/08/05` or `2017:08:05`; returns days since 1970, nullopt if there is no such
/// day.
std::optional<double> take_day(std::string_view& text);

/// Parses an ISO 8601 date and time (`2024-05-06T07:08:09.25Z`; an offset such as `+02:00` or `-0530`; a blank instead
/// of the T; dates in any form of take_day; `7:08:09 PM`): seconds since 1970 in UTC, leap seconds not counted. A time
/// without an offset is taken as UTC. nullopt if the whole text is not such a time.
std::optional<double> parse_iso_time_s(std::string_view text);

/// Orders names as people do: numbers within them by value ("frame_2" before "frame_10"), digits behind a number's
/// point as its fraction ("0.25" before "0.5"), everything else by bytes. A strict order: only equal names are
/// equivalent.
bool natural_less(std::string_view a, std::string_view b);

}  // namespace tileflight::base
