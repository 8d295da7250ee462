#pragma once

#include <string>
#include <vector>

namespace tileflight::report {

/// A number for an attribute of SVG: two decimals, no more zeros than needed.
std::string svg_number(double value);

/// Steps of 1, 2 or 5 times a power of ten that cover [low, high], about `wanted` of them; those inside the range.
std::vector<double> nice_ticks(double low, double high, int wanted);

/// A tick's text with as many decimals as its step needs.
std::string tick_text(double value, double step);

/// The largest 1, 2 or 5 times a power of ten that is not above `value`.
double nice_below(double value);

}  // namespace tileflight::report
