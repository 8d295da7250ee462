#include "tileflight/core/base/text_fields.h"

#include <algorithm>
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

}  // namespace tileflight::base
