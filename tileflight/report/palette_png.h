#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "tileflight/imaging/image.h"

namespace tileflight::report {

using Rgba8 = std::array<std::uint8_t, 4>;  ///< red, green, blue, opacity

/// A picture of at most 256 colours with opacity: each pixel is an index into the palette. Points on a transparent
/// ground, as the page's layers are, take a tenth of what full colour takes.
struct PaletteImage {
  imaging::GrayImage indices;
  std::vector<Rgba8> palette;
};

/// PNG with PLTE and tRNS chunks (ISO/IEC 15948). The same image gives the same bytes.
std::string encode_png(const PaletteImage& image);

}  // namespace tileflight::report
