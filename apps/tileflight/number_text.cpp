#include "number_text.h"

#include <cmath>
#include <nlohmann/json.hpp>

#include "tileflight/core/base/formatted_text.h"

namespace tileflight::app {

std::string rounded(double number, int significant) {
  if (!std::isfinite(number)) return std::isnan(number) ? "unknown" : number > 0 ? "infinite" : "-infinite";
  if (number == 0.0) return "0";
  constexpr double kManyDigits = 1e15, kManyZeros = 1e-4;
  const double size = std::abs(number);
  if (size >= kManyDigits || size < kManyZeros) return base::formatted("%.*g", significant, number);
  const int before_point = static_cast<int>(std::floor(std::log10(size))) + 1;
  return base::trimmed_text(number, std::max(0, significant - before_point));
}

std::string rounded(const nlohmann::json& number, int significant) {
  if (number.is_number_integer()) return number.dump();
  return number.is_number() ? rounded(number.get<double>(), significant) : "unknown";
}

std::string rounded_list(const nlohmann::json& numbers, int significant) {
  if (!numbers.is_array()) return rounded(numbers, significant);
  std::string text;
  for (const nlohmann::json& number : numbers) text += (text.empty() ? "" : ", ") + rounded(number, significant);
  return "[" + text + "]";
}

std::string percent_text(const nlohmann::json& share) {
  return share.is_number() ? rounded(100.0 * share.get<double>(), 3) + " %" : "an unknown share";
}

std::string duration_text(double seconds) {
  constexpr double kTenths = 10.0;
  if (seconds < kTenths) return base::rounded_text(seconds, 1) + " s";
  const auto whole = static_cast<long>(std::lround(seconds));
  const auto text = [](long number, const char* unit) { return std::to_string(number) + " " + unit; };
  if (whole < 60) return text(whole, "s");
  if (whole < 3600) return text(whole / 60, "min") + (whole % 60 > 0 ? " " + text(whole % 60, "s") : "");
  const long minutes = (whole + 30) / 60;
  return text(minutes / 60, "h") + (minutes % 60 > 0 ? " " + text(minutes % 60, "min") : "");
}

}  // namespace tileflight::app
