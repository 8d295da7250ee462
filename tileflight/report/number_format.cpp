#include "tileflight/report/number_format.h"

#include <nlohmann/json.hpp>

#include <charconv>
#include <cmath>
#include <cstdio>

namespace tileflight::report {
namespace {

/// printf("%.*f"), independent of the locale.
std::string in_decimals(double value, int decimals) {
  char digits[352];
  const auto [end, fault] = std::to_chars(digits, digits + sizeof(digits), value, std::chars_format::fixed, decimals);
  return fault == std::errc() ? std::string(digits, end) : kUnknown;
}

}  // namespace

std::optional<double> number_at(const nlohmann::json& json, const std::string& pointer) {
  const nlohmann::json::json_pointer place(pointer);
  if (!json.contains(place) || !json.at(place).is_number()) return std::nullopt;
  const double value = json.at(place).get<double>();
  return std::isfinite(value) ? std::optional(value) : std::nullopt;
}

std::optional<std::string> text_at(const nlohmann::json& json, const std::string& pointer) {
  const nlohmann::json::json_pointer place(pointer);
  if (!json.contains(place) || !json.at(place).is_string()) return std::nullopt;
  return json.at(place).get<std::string>();
}

std::string format_fixed(const std::optional<double>& value, int decimals) {
  return value && std::isfinite(*value) ? in_decimals(*value, decimals) : kUnknown;
}

std::string format_count(const std::optional<double>& value) {
  if (!value || !std::isfinite(*value)) return kUnknown;
  std::string digits = in_decimals(std::abs(*value), 0);
  for (std::size_t place = digits.size(); place > 3;) digits.insert(place -= 3, ",");
  return (*value < 0 ? "-" : "") + digits;
}

std::string format_shortest(const std::optional<double>& value) {
  if (!value || !std::isfinite(*value)) return kUnknown;
  char digits[64];
  std::snprintf(digits, sizeof(digits), "%.4g", *value);
  return digits;
}

std::string format_percent(const std::optional<double>& share, int decimals) {
  return share && std::isfinite(*share) ? in_decimals(100 * *share, decimals) + "\u00A0%" : kUnknown;
}

std::string format_signed(const std::optional<double>& value, int decimals) {
  if (!value || !std::isfinite(*value)) return kUnknown;
  return (std::signbit(*value) ? "\u2212" : "+") + format_fixed(std::abs(*value), decimals);
}

}  // namespace tileflight::report
