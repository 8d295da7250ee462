#pragma once

#include <numbers>

namespace tileflight::geometry {

inline constexpr double kRadiansPerDegree = std::numbers::pi / 180.0;

}  // namespace tileflight::geometry
