#include "tileflight/core/drawing/number_format.h"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "tileflight/core/base/formatted_text.h"

namespace tileflight::drawing {
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
  return value && std::isfinite(*value) ? base::rounded_text(*value, decimals) : kUnknown;
}

std::string format_count(const std::optional<double>& value) {
  if (!value || !std::isfinite(*value)) return kUnknown;
  std::string digits = base::rounded_text(std::abs(*value), 0);
  for (std::size_t place = digits.size(); place > 3;) digits.insert(place -= 3, ",");
  return (*value < 0 ? "-" : "") + digits;
}

std::string format_shortest(const std::optional<double>& value) {
  if (!value || !std::isfinite(*value)) return kUnknown;
  return base::formatted("%.4g", *value);
}

std::string format_percent(const std::optional<double>& share, int decimals) {
  return share && std::isfinite(*share) ? base::rounded_text(100 * *share, decimals) + "\u00A0%" : kUnknown;
}

std::string format_signed(const std::optional<double>& value, int decimals) {
  if (!value || !std::isfinite(*value)) return kUnknown;
  return (std::signbit(*value) ? "\u2212" : "+") + format_fixed(std::abs(*value), decimals);
}

std::size_t display_width(const std::string& text) {
  return static_cast<std::size_t>(std::count_if(text.begin(), text.end(), [](char c) { return (c & 0xC0) != 0x80; }));
}

}  // namespace tileflight::drawing
