#pragma once

#include <span>
#include <string>

#include "tileflight/imaging/camera.h"

namespace tileflight::imaging {

/// Largest image side that a calibration may name, pixels.
inline constexpr int kMaxImageSide_px = 1 << 20;

/// What a calibration file of either format says of the lens, as plain numbers.
struct LensNumbers {
  std::string distortion;         ///< radtan, equidistant, fov or none
  std::span<const double> focal;  ///< fx fy cx cy, pixels
  std::span<const double> distortion_coefficients;
  int width = 0, height = 0;
};

/// The camera, after checking counts, finiteness and signs. Throws InputError(file, cause).
Camera checked_camera(const std::string& file, const LensNumbers& numbers);

/// Shortest text that reads back as the same number.
std::string number_text(double value);

}  // namespace tileflight::imaging
