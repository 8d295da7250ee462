#pragma once

#include <nlohmann/json.hpp>
#include <string>

namespace tileflight::app {

/// Formats a number for people: `significant` digits, no trailing zeros, and no exponent unless that would need more
/// than a few zeros. "12500" for 12500.0, "0.0123" for 0.012345678 (3 digits). Integers keep all digits.
std::string rounded(double number, int significant = 4);

/// Formats a number of a JSON result in the same way; "unknown" for null.
std::string rounded(const nlohmann::json& number, int significant = 4);

/// Formats a list of numbers: "[-0.012, 0.034]".
std::string rounded_list(const nlohmann::json& numbers, int significant = 4);

/// Formats a share as per cent: "83 %" for 0.83, "0.4 %" for 0.004, "an unknown share" for null.
std::string percent_text(const nlohmann::json& share);

/// Formats a duration: "0.4 s", "12 s", "3 min 20 s", "1 h 5 min".
std::string duration_text(double seconds);

}  // namespace tileflight::app
