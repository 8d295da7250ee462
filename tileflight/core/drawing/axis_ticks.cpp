#include "tileflight/core/drawing/axis_ticks.h"

#include <algorithm>
#include <cmath>

#include "tileflight/core/drawing/number_format.h"

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

}  // namespace tileflight::drawing
