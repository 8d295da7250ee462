#pragma once

#include <cstddef>
#include <vector>

#include "tileflight/imaging/image.h"

namespace tileflight::imaging {

/// Encodes a PNG in a quarter of encode_png()'s time, but some tenths larger: for temporary images.
std::vector<std::byte> encode_png_fast(const RgbImage& image);

}  // namespace tileflight::imaging
