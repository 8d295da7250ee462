#pragma once

#include <nlohmann/json.hpp>
#include <string>

namespace tileflight::app {

/// A number as people read it: so many significant digits, without zeros at its end and without an exponent where that
/// takes no more than a few zeros. "12500" of 12500.0, "0.0123" of 0.012345678 (3 digits). Whole numbers keep all their
/// digits.
std::string rounded(double number, int significant = 4);

/// The same of a number in a result; "unknown" of null.
std::string rounded(const nlohmann::json& number, int significant = 4);

/// "[-0.012, 0.034]" of a list of numbers.
std::string rounded_list(const nlohmann::json& numbers, int significant = 4);

/// "83 %" of a share of 0.83; "0.4 %" of little; "unknown" of null.
std::string percent_text(const nlohmann::json& share);

/// "0.4 s", "12 s", "3 min 20 s", "1 h 5 min": how long something takes.
std::string duration_text(double seconds);

}  // namespace tileflight::app
