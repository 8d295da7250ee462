#pragma once

#include <nlohmann/json.hpp>
#include <optional>
#include <string>

namespace tileflight::report {

/// What stands where a value is not known.
inline constexpr const char* kUnknown = "\u2013";

/// The number at a JSON pointer ("/map/mean"); nullopt when it is absent, null or no number.
std::optional<double> number_at(const nlohmann::json& json, const std::string& pointer);
std::optional<std::string> text_at(const nlohmann::json& json, const std::string& pointer);

/// 0.5548 with 4 decimals; kUnknown without a finite value.
std::string fixed(const std::optional<double>& value, int decimals);
/// 84,029.
std::string count(const std::optional<double>& value);
/// As few digits as tell the value: 5, 29.97, 0.0014.
std::string shortest(const std::optional<double>& value);
/// A share as a percentage: 0.4305 is 43.1 %.
std::string percent(const std::optional<double>& share, int decimals = 1);
/// With its sign (a true minus, U+2212): +0.019.
std::string with_sign(const std::optional<double>& value, int decimals);

}  // namespace tileflight::report
