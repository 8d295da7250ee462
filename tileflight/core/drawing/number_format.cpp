#include "tileflight/core/drawing/number_format.h"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "tileflight/core/base/formatted_text.h"

namespace tileflight::drawing {

std::string svg_number(double value) {
  std::string digits = format_fixed(value, 2);
  if (digits.find('.') == std::string::npos) return digits;
  digits.erase(digits.find_last_not_of('0') + 1);
  if (digits.back() == '.') digits.pop_back();
  return digits == "-0" ? "0" : digits;
}

double round_down_to_nice(double value) {
  const double power = std::pow(10.0, std::floor(std::log10(value)));
  for (const double factor : {5.0, 2.0}) {
    if (factor * power <= value * (1 + 1e-12)) return factor * power;
  }
  return power;
}

std::vector<double> nice_ticks(double low, double high, int count) {
  if (!(high > low)) return {low};
  double step = round_down_to_nice((high - low) / count);
  while ((high - low) / step > 2.0 * count) step *= 2;
  std::vector<double> ticks;
  for (double i = std::ceil(low / step - 1e-9); i * step <= high + 1e-9 * step; ++i) ticks.push_back(i * step);
  return ticks;
}

std::string tick_text(double value, double step) {
  const int decimals = std::max(0, static_cast<int>(std::ceil(-std::log10(step) - 1e-9)));
  const std::string text = format_fixed(value, decimals);
  return std::strtod(text.c_str(), nullptr) == 0.0 ? format_fixed(0.0, decimals) : text;
}

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
