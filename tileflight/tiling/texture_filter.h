#pragma once

#include "tileflight/imaging/image.h"

namespace tileflight::tiling {

/// The image at another, not larger size; each pixel is the mean of the area that it covers.
imaging::RgbImage shrunk(const imaging::RgbImage& image, int width, int height);

/// Each pixel the mean of its 3 x 3 neighbourhood with binomial weights (1 2 1); the edge is repeated beyond itself.
imaging::RgbImage blurred(const imaging::RgbImage& image);

}  // namespace tileflight::tiling
