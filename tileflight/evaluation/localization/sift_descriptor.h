#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "tileflight/core/imaging/image.h"

namespace tileflight::localization {

/// Gradient histograms around a feature: 4 x 4 cells of 8 directions, relative to its size and direction.
using SiftDescriptor = std::array<std::uint8_t, 128>;

/// Dominant gradient directions around (x, y), radians from x (right) to y (down): the peaks of a histogram of 36
/// directions, at most two (section 5 of Lowe's paper). `image`: blurred by `sigma`, pixels.
std::vector<float> dominant_orientations(const imaging::FloatImage& image, float x, float y, float sigma);

/// Of the gradients around (x, y) of an image blurred by `sigma`, turned by `angle_rad` (section 6); square roots as in
/// RootSIFT.
SiftDescriptor compute_descriptor(const imaging::FloatImage& image, float x, float y, float sigma, float angle_rad);

}  // namespace tileflight::localization
