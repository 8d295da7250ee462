#pragma once

#include <cstdint>
#include <vector>

#include "tileflight/imaging/image.h"

namespace tileflight::simulator {

/// A PNG of 8-bit red, green, blue and an alpha of 255 everywhere, as AirSim's clients expect. Quick rather than small:
/// rows are differences to the row above (filter "up") and deflated in stripes by several threads; the same bytes for
/// any number of them.
std::vector<std::uint8_t> png_rgba(const imaging::RgbImage& image);

}  // namespace tileflight::simulator
