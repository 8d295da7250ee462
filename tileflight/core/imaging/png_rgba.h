#pragma once

#include <cstdint>
#include <vector>

#include "tileflight/core/imaging/image.h"

namespace tileflight::imaging {

/// Encodes an 8-bit RGBA PNG with alpha 255 everywhere, as AirSim's clients expect. Optimized for speed rather than
/// size: rows are filtered as differences to the row above (filter "up") and deflated in stripes by several threads;
/// the bytes do not depend on the number of threads.
std::vector<std::uint8_t> encode_png_rgba(const RgbImage& image);

}  // namespace tileflight::imaging
