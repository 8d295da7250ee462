#pragma once

#include <cstddef>
#include <vector>

#include "tileflight/imaging/image.h"

namespace tileflight::imaging {

/// A PNG in a quarter of encode_png()'s time and some tenths larger: for pictures that are soon read again.
std::vector<std::byte> encode_quick_png(const RgbImage& image);

}  // namespace tileflight::imaging
