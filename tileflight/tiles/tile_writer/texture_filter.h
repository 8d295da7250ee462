#pragma once

#include "tileflight/core/imaging/image.h"

namespace tileflight::tile_writer {

/// Resizes an image to equal or smaller size; each pixel is the mean of the area that it covers.
imaging::RgbImage resize_area(const imaging::RgbImage& image, int width, int height);

/// 3 x 3 binomial blur (weights 1 2 1); edge pixels are repeated beyond the edge.
imaging::RgbImage blur_binomial(const imaging::RgbImage& image);

}  // namespace tileflight::tile_writer
