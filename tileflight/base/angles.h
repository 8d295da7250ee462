#pragma once

#include <numbers>

namespace tileflight::base {

inline constexpr double kRadiansPerDegree = std::numbers::pi / 180.0;

}  // namespace tileflight::base
