#pragma once

#include <array>
#include <optional>

#include "tileflight/core/imaging/plane_distortion.h"

/// OpenCV's rational and thin-prism distortion (docs.opencv.org, "Camera Calibration and 3D Reconstruction"), without
/// the tilted sensor: coefficients k1 k2 p1 p2 k3 k4 k5 k6 s1 s2 s3 s4.
namespace tileflight::imaging::rational {

using Coefficients = std::array<double, 12>;

/// x N/D + 2 p1 x y + p2 (r^2 + 2 x^2) + s1 r^2 + s2 r^4, y N/D + p1 (r^2 + 2 y^2) + 2 p2 x y + s3 r^2 + s4 r^4, with
/// N = 1 + k1 r^2 + k2 r^4 + k3 r^6 and D = 1 + k4 r^2 + k5 r^4 + k6 r^6.
DistortedPoint distort(const Coefficients& d, const geometry::Vec2& m);

/// Whether the distortion is purely radial, so that the lens is symmetric about its axis.
bool is_radial(const Coefficients& d);

/// Radius at which r N/D stops increasing or D is zero; 1e6, practically infinite, if it increases beyond.
double max_valid_radius(const Coefficients& d);

/// Inverse of distort(), with a radius of at most `max_radius`; nullopt if there is no solution.
std::optional<geometry::Vec2> undistort(const Coefficients& d, double max_radius, const geometry::Vec2& target);

}  // namespace tileflight::imaging::rational
