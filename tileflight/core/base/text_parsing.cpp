#include "tileflight/core/base/text_parsing.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <chrono>
#include <cmath>

#include "tileflight/core/base/input_error.h"

namespace tileflight::base {

std::optional<std::string_view> take_line(std::string_view& text) {
  if (text.empty()) return std::nullopt;
  const std::size_t end = std::min(text.find('\n'), text.size());
  std::string_view line = text.substr(0, end);
  text.remove_prefix(std::min(end + 1, text.size()));
  if (line.ends_with('\r')) line.remove_suffix(1);
  return line;
}

std::string_view take_field(std::string_view& line, std::string_view separators) {
  line.remove_prefix(std::min(line.find_first_not_of(separators), line.size()));
  const std::string_view field = line.substr(0, line.find_first_of(separators));
  line.remove_prefix(field.size());
  return field;
}

std::vector<std::string_view> split_fields(std::string_view line, std::string_view separators) {
  std::vector<std::string_view> fields;
  for (auto field = take_field(line, separators); !field.empty(); field = take_field(line, separators)) {
    fields.push_back(field);
  }
  return fields;
}

void for_each_row(std::string_view text, const std::string& file, std::string_view separators,
                  const std::function<void(const TextRow& row)>& take) {
  for (int number = 1; const auto line = take_line(text); ++number) {
    std::vector<std::string_view> fields = split_fields(*line, separators);
    if (fields.empty() || fields.front().starts_with('#')) continue;
    take({number, file + ": line " + std::to_string(number), std::move(fields)});
  }
}

double require_finite(const std::string& where, std::string_view field) {
  const auto value = parse_number<double>(field);
  if (!value || !std::isfinite(*value))
    throw InputError(where, "\"" + std::string(field) + "\" is not a finite number");
  return *value;
}

std::string to_lower(std::string_view text) {
  std::string lower(text);
  for (char& c : lower) c = c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c;
  return lower;
}

std::string csv_field(std::string_view plain) {
  if (plain.find_first_of(",\"\r\n") == std::string_view::npos) return std::string(plain);
  std::string quoted = "\"";
  for (const char c : plain) quoted += c == '"' ? std::string("\"\"") : std::string(1, c);
  return quoted + '"';
}

namespace {

bool is_blank(char c) { return c == ' ' || c == '\t' || c == '\r' || c == '\n'; }

/// Seconds after the decimal point or comma of a clock: any number of digits.
double take_fraction(std::string_view& text) {
  double value = 0, place = 0.1;
  while (!text.empty() && is_digit(text.front())) {
    value += place * (text.front() - '0');
    place /= 10.0;
    text.remove_prefix(1);
  }
  return value;
}

/// HH:MM, optionally with :SS and a fraction.
std::optional<double> take_iso_clock(std::string_view& text) {
  const std::optional<int> hours = take_digits(text);
  if (!hours || *hours > 24 || !take_prefix(text, ":")) return std::nullopt;
  const std::optional<int> minutes = take_digits(text);
  if (!minutes || *minutes > 59) return std::nullopt;
  double seconds = 0;
  if (take_prefix(text, ":")) {
    const std::optional<int> whole = take_digits(text);
    if (!whole || *whole > 60) return std::nullopt;  // 60: a leap second
    seconds = *whole;
    if (take_prefix(text, ".") || take_prefix(text, ",")) seconds += take_fraction(text);
  }
  return 3600.0 * *hours + 60.0 * *minutes + seconds;
}

/// `Z`, `+02:00`, `-0530`, `+02`, or nothing: offset from UTC in seconds.
std::optional<double> take_offset(std::string_view& text) {
  if (text.empty() || take_prefix(text, "Z") || take_prefix(text, "z")) return 0.0;
  const double sign = text.front() == '-' ? -1.0 : 1.0;
  if (!take_prefix(text, "+") && !take_prefix(text, "-")) return std::nullopt;
  std::string_view first = text.substr(0, std::min<std::size_t>(text.size(), 2));
  text.remove_prefix(first.size());
  const std::optional<int> hours = take_digits(first);
  take_prefix(text, ":");
  const std::optional<int> minutes = text.empty() ? 0 : take_digits(text);
  if (!hours || !minutes || !first.empty() || *hours > 18 || *minutes > 59) return std::nullopt;
  return sign * (3600.0 * *hours + 60.0 * *minutes);
}

}  // namespace

bool is_digit(char c) { return c >= '0' && c <= '9'; }

std::string_view trim(std::string_view text) {
  while (!text.empty() && is_blank(text.front())) text.remove_prefix(1);
  while (!text.empty() && is_blank(text.back())) text.remove_suffix(1);
  return text;
}

std::string_view strip_byte_order_mark(std::string_view text) {
  return text.starts_with("\xEF\xBB\xBF") ? text.substr(3) : text;
}

bool take_prefix(std::string_view& text, std::string_view expected) {
  if (!text.starts_with(expected)) return false;
  text.remove_prefix(expected.size());
  return true;
}

std::optional<double> take_number(std::string_view& text) {
  std::string_view rest = text;
  while (!rest.empty() && is_blank(rest.front())) rest.remove_prefix(1);
  if (!rest.empty() && rest.front() == '+') rest.remove_prefix(1);
  double value = 0;
  const auto [end, fault] = std::from_chars(rest.data(), rest.data() + rest.size(), value);
  if (fault != std::errc() || !std::isfinite(value)) return std::nullopt;
  text = rest.substr(static_cast<std::size_t>(end - rest.data()));
  return value;
}

std::optional<double> parse_finite_number(std::string_view text) {
  const std::optional<double> value = take_number(text);
  return value && trim(text).empty() ? value : std::nullopt;
}

std::optional<double> parse_decimal_number(std::string_view text) {
  if (const std::optional<double> value = parse_finite_number(text)) return value;
  std::string with_point(text);
  const std::size_t comma = with_point.find(',');
  if (comma == std::string::npos || with_point.find('.') != std::string::npos) return std::nullopt;
  with_point[comma] = '.';
  return parse_finite_number(with_point);
}

std::optional<double> parse_angle_deg(std::string_view text) {
  if (const std::optional<double> value = parse_decimal_number(text)) return value;
  text = trim(text);
  char hemisphere = '\0';
  if (!text.empty() && std::string_view("NSEWnsew").find(text.back()) != std::string_view::npos) {
    hemisphere = to_lower(text.substr(text.size() - 1)).front();
    text.remove_suffix(1);
  }
  // The whole part before the degree sign, then minutes and seconds.
  std::size_t sign = text.find("deg");
  std::size_t after = sign + 3;
  if (sign == std::string_view::npos) {
    sign = text.find("\xC2\xB0");
    after = sign + 2;
  }
  std::optional<double> degrees = parse_decimal_number(text.substr(0, sign));
  std::string_view rest = sign == std::string_view::npos ? "" : trim(text.substr(after));
  if (!degrees || (hemisphere != '\0' && *degrees < 0.0)) return std::nullopt;
  if (!rest.empty() && hemisphere == '\0') return std::nullopt;
  double part = 60.0;
  for (const char mark : {'\'', '"'}) {
    if (const std::size_t end = rest.find(mark); end != std::string_view::npos) {
      const std::optional<double> value = parse_decimal_number(rest.substr(0, end));
      if (!value || *value < 0.0 || *value >= 60.0) return std::nullopt;
      *degrees += *value / part;
      rest = trim(rest.substr(end + 1));
    }
    part *= 60.0;
  }
  if (!rest.empty()) return std::nullopt;
  return hemisphere == 's' || hemisphere == 'w' ? -*degrees : *degrees;
}

TimeUnit guess_time_unit(double first_time) {
  if (first_time < 1e11) return {};
  if (first_time < 1e14) return {1e-3, "milliseconds"};
  if (first_time < 1e17) return {1e-6, "microseconds"};
  return {1e-9, "nanoseconds"};
}

std::optional<int> take_digits(std::string_view& text) {
  std::size_t count = 0;
  while (count < text.size() && count < 9 && is_digit(text[count])) ++count;
  if (count == 0) return std::nullopt;
  int value = 0;
  std::from_chars(text.data(), text.data() + count, value);
  text.remove_prefix(count);
  return value;
}

std::optional<double> take_clock(std::string_view& text) {
  std::array<int, 3> parts{};
  for (std::size_t i = 0; i < 3; ++i) {
    if (i > 0 && !take_prefix(text, ":")) return std::nullopt;
    const std::optional<int> part = take_digits(text);
    if (!part) return std::nullopt;
    parts[i] = *part;
  }
  double fraction_s = 0;
  if (take_prefix(text, ",") || take_prefix(text, ".")) {
    const std::size_t before = text.size();
    const int digits = take_digits(text).value_or(0);
    // Up to three digits are milliseconds, as subtitles have them; more are a fraction.
    fraction_s = digits / std::pow(10.0, std::max<double>(3.0, static_cast<double>(before - text.size())));
  }
  return 3600.0 * parts[0] + 60.0 * parts[1] + parts[2] + fraction_s;
}

std::optional<double> take_day(std::string_view& text) {
  std::array<int, 3> date{};
  for (std::size_t i = 0; i < 3; ++i) {
    if (i > 0 && !take_prefix(text, ".") && !take_prefix(text, "-") && !take_prefix(text, "/") &&
        !take_prefix(text, ":"))
      return std::nullopt;
    const std::optional<int> part = take_digits(text);
    if (!part) return std::nullopt;
    date[i] = *part;
  }
  const std::chrono::year_month_day day{std::chrono::year{date[0]}, std::chrono::month(static_cast<unsigned>(date[1])),
                                        std::chrono::day(static_cast<unsigned>(date[2]))};
  constexpr int kFirstYear = 1000;  // "05-06-24" is no date of the year 5
  if (date[0] < kFirstYear || date[0] > 9999 || date[1] > 12 || date[2] > 31 || !day.ok()) return std::nullopt;
  return static_cast<double>(std::chrono::sys_days(day).time_since_epoch().count());
}

namespace {

/// Takes AM or PM from the front, if there is one, and returns the time of the day; nullopt: no such hour.
std::optional<double> take_half_of_day(std::string_view& text, double clock_s) {
  constexpr double kHalf_s = 43200.0, kHour_s = 3600.0;
  const bool is_am = take_prefix(text, "AM") || take_prefix(text, "am");
  if (!is_am && !take_prefix(text, "PM") && !take_prefix(text, "pm")) return clock_s;
  if (clock_s < kHour_s || clock_s >= kHalf_s + kHour_s) return std::nullopt;
  return std::fmod(clock_s, kHalf_s) + (is_am ? 0.0 : kHalf_s);  // 12 AM is the first hour
}

}  // namespace

std::optional<double> parse_iso_time_s(std::string_view text) {
  text = trim(text);
  const std::optional<double> day = take_day(text);
  if (!day || (!take_prefix(text, "T") && !take_prefix(text, "t") && !take_prefix(text, " "))) return std::nullopt;
  text = trim(text);
  const std::optional<double> written_s = take_iso_clock(text);
  if (!written_s) return std::nullopt;
  text = trim(text);
  const std::optional<double> clock_s = take_half_of_day(text, *written_s);
  if (!clock_s) return std::nullopt;
  text = trim(text);
  const std::optional<double> offset_s = take_offset(text);
  if (!offset_s || !trim(text).empty()) return std::nullopt;
  return 86400.0 * *day + *clock_s - *offset_s;
}

namespace {

/// Takes the digits at the front, any number of them.
std::string_view take_digit_run(std::string_view& text) {
  std::size_t count = 0;
  while (count < text.size() && is_digit(text[count])) ++count;
  const std::string_view run = text.substr(0, count);
  text.remove_prefix(count);
  return run;
}

/// Negative if the whole number `a` is less than `b`, positive if it is greater.
int compare_whole(std::string_view a, std::string_view b) {
  a.remove_prefix(std::min(a.find_first_not_of('0'), a.size()));
  b.remove_prefix(std::min(b.find_first_not_of('0'), b.size()));
  if (a.size() != b.size()) return a.size() < b.size() ? -1 : 1;
  return a.compare(b);
}

}  // namespace

bool natural_less(std::string_view a, std::string_view b) {
  std::string_view left = a, right = b;
  bool follows_number = false, in_fraction = false;
  while (!left.empty() && !right.empty()) {
    if (is_digit(left.front()) && is_digit(right.front())) {
      const std::string_view x = take_digit_run(left), y = take_digit_run(right);
      const int order = in_fraction ? x.compare(y) : compare_whole(x, y);
      if (order != 0) return order < 0;
      follows_number = !in_fraction;
      in_fraction = false;
      continue;
    }
    if (left.front() != right.front())
      return static_cast<unsigned char>(left.front()) < static_cast<unsigned char>(right.front());
    in_fraction = follows_number && left.front() == '.';
    follows_number = false;
    left.remove_prefix(1);
    right.remove_prefix(1);
  }
  if (left.empty() != right.empty()) return left.empty();
  return a < b;  // the same numbers, with other leading zeros
}

}  // namespace tileflight::base
