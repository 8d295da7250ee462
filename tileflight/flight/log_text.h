#pragma once

#include <cstdint>
#include <optional>
#include <string_view>

namespace tileflight::flight {

/// A log of text larger than this is refused: an hour of 60 Hz subtitles is about 60 MB.
inline constexpr std::uintmax_t kLargestLogBytes = std::uintmax_t{1} << 30;

bool is_digit(char c);

/// Without blanks, tabs and line ends at both ends.
std::string_view trimmed(std::string_view text);

/// Without the three bytes that mark UTF-8.
std::string_view without_byte_order_mark(std::string_view text);

/// Takes `expected` from the front if it is there.
bool take(std::string_view& text, std::string_view expected);

/// Takes a finite number from the front (spaces before it and a leading '+' are skipped); nullopt and `text` as it was
/// if there is none.
std::optional<double> take_number(std::string_view& text);

/// The whole text, but for blanks around it, as one finite number.
std::optional<double> whole_number_text(std::string_view text);

/// Takes the digits at the front (nine at most) as a whole number, for dates and stamps ("08" is 8).
std::optional<int> take_digits(std::string_view& text);

/// HH:MM:SS, then milliseconds after a comma or a point: seconds.
std::optional<double> take_clock(std::string_view& text);

/// Takes `2017.08.05`, `2017-08-05`, `2017/08/05` or `2017:08:05`: days since 1970. nullopt if there is no such day.
std::optional<double> take_day(std::string_view& text);

/// ISO 8601 date and time (`2024-05-06T07:08:09.25Z`; an offset such as `+02:00` or `-0530`; a blank for the T; also
/// days written as take_day has them): seconds since 1970 in UTC, leap seconds not counted. Without an offset the time
/// is taken as UTC. nullopt where the whole text is not such a time.
std::optional<double> iso_time_s(std::string_view text);

}  // namespace tileflight::flight
