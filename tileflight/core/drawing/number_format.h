#pragma once

#include <cstddef>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <vector>

namespace tileflight::drawing {

/// Formats a number for an SVG attribute: at most two decimals, without trailing zeros.
std::string svg_number(double value);

/// Returns about `count` ticks within [low, high], at multiples of 1, 2 or 5 times a power of ten.
std::vector<double> nice_ticks(double low, double high, int count);

/// Returns a tick's label, with as many decimals as its step needs.
std::string tick_text(double value, double step);

/// Returns the largest number of the form 1, 2 or 5 times a power of ten that is not above `value`.
double round_down_to_nice(double value);

/// The text that stands for an unknown value.
inline constexpr const char* kUnknown = "\u2013";

/// Returns the number at a JSON pointer ("/map/mean"); nullopt if it is absent, null or not a number.
std::optional<double> number_at(const nlohmann::json& json, const std::string& pointer);
std::optional<std::string> text_at(const nlohmann::json& json, const std::string& pointer);

/// Formats a number with a fixed number of decimals (0.5548); kUnknown if there is no finite value.
std::string format_fixed(const std::optional<double>& value, int decimals);
/// Formats a count with separators of thousands (84,029).
std::string format_count(const std::optional<double>& value);
/// Formats a number with the fewest digits that represent it: 5, 29.97, 0.0014.
std::string format_shortest(const std::optional<double>& value);
/// Formats a share as a percentage: 0.4305 becomes 43.1 %.
std::string format_percent(const std::optional<double>& share, int decimals = 1);
/// Formats a number with an explicit sign (a true minus, U+2212): +0.019.
std::string format_signed(const std::optional<double>& value, int decimals);

/// Returns the number of characters, not bytes: the terminal columns of a text (every character used here takes one).
std::size_t display_width(const std::string& text);

}  // namespace tileflight::drawing
