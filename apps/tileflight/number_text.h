#pragma once

#include <nlohmann/json.hpp>
#include <string>

namespace tileflight::app {

/// Formats a number for people: `significant` digits, no trailing zeros, and no exponent unless that would need more
/// than a few zeros. "12500" for 12500.0, "0.0123" for 0.012345678 (3 digits). Integers keep all digits.
std::string rounded(double number, int significant = 4);

/// As above for a number in a result; "unknown" for null.
std::string rounded(const nlohmann::json& number, int significant = 4);

/// "[-0.012, 0.034]" for a list of numbers.
std::string rounded_list(const nlohmann::json& numbers, int significant = 4);

/// "83 %" for a share of 0.83; "0.4 %" for small shares; "unknown" for null.
std::string percent_text(const nlohmann::json& share);

/// A duration: "0.4 s", "12 s", "3 min 20 s", "1 h 5 min".
std::string duration_text(double seconds);

}  // namespace tileflight::app
