#pragma once

#include <array>
#include <optional>

#include "tileflight/core/imaging/plane_distortion.h"

/// Radial and tangential distortion in normalised coordinates (Brown 1966; OpenCV's first four: k1 k2 p1 p2).
namespace tileflight::imaging::brown_conrady {

/// x (1 + k1 r^2 + k2 r^4) + 2 p1 x y + p2 (r^2 + 2 x^2); y likewise, with p1 and p2 exchanged.
DistortedPoint distort(const std::array<double, 4>& d, const geometry::Vec2& m);

/// Radius at which r (1 + k1 r^2 + k2 r^4) stops increasing; nullopt if it always increases.
std::optional<double> max_valid_radius(const std::array<double, 4>& d);

/// Inverse of distort(), with a radius of at most `max_radius`; nullopt if there is no solution.
std::optional<geometry::Vec2> undistort(const std::array<double, 4>& d, std::optional<double> max_radius,
                                        const geometry::Vec2& target);

}  // namespace tileflight::imaging::brown_conrady
