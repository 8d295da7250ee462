#pragma once

#include <string>
#include <vector>

namespace tileflight::drawing {

/// Formats a number for an SVG attribute: at most two decimals, without trailing zeros.
std::string svg_number(double value);

/// About `count` ticks within [low, high], at multiples of 1, 2 or 5 times a power of ten.
std::vector<double> nice_ticks(double low, double high, int count);

/// A tick's label, with as many decimals as its step needs.
std::string tick_text(double value, double step);

/// The largest number of the form 1, 2 or 5 times a power of ten that is not above `value`.
double round_down_to_nice(double value);

}  // namespace tileflight::drawing
