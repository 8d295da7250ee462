#pragma once

#include <cstdint>
#include <optional>
#include <string_view>

namespace tileflight::base {

/// Text logs larger than this are refused: an hour of 60 Hz subtitles is about 60 MB.
inline constexpr std::uintmax_t kMaxLogBytes = std::uintmax_t{1} << 30;

bool is_digit(char c);

/// The text without blanks, tabs and line ends at both ends.
std::string_view trim(std::string_view text);

/// The text without a leading UTF-8 byte order mark.
std::string_view strip_byte_order_mark(std::string_view text);

/// Removes `expected` from the front of `text` if it is there; returns whether it was.
bool take_prefix(std::string_view& text, std::string_view expected);

/// Takes a finite number from the front (leading spaces and '+' are skipped); nullopt, with `text` unchanged, if there
/// is none.
std::optional<double> take_number(std::string_view& text);

/// Parses the whole text, apart from surrounding blanks, as one finite number.
std::optional<double> parse_finite_number(std::string_view text);

/// Takes the digits at the front (nine at most) as an integer, for dates and time stamps ("08" is 8).
std::optional<int> take_digits(std::string_view& text);

/// Takes HH:MM:SS with optional milliseconds after a comma or a point; returns seconds.
std::optional<double> take_clock(std::string_view& text);

/// Takes `2017.08.05`, `2017-08-05`, `2017/08/05` or `2017:08:05`; returns days since 1970, nullopt if there is no such
/// day.
std::optional<double> take_day(std::string_view& text);

/// Parses an ISO 8601 date and time (`2024-05-06T07:08:09.25Z`; an offset such as `+02:00` or `-0530`; a blank instead
/// of the T; dates in any form of take_day): seconds since 1970 in UTC, leap seconds not counted. A time without an
/// offset is taken as UTC. nullopt if the whole text is not such a time.
std::optional<double> parse_iso_time_s(std::string_view text);

}  // namespace tileflight::base
