#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "tileflight/core/imaging/image.h"

namespace tileflight::drawing {

using Rgba8 = std::array<std::uint8_t, 4>;  ///< red, green, blue, opacity

/// An indexed image of at most 256 colours with opacity. For points on a transparent background, as the page's layers
/// are, the file is a tenth of a full-colour one.
struct PaletteImage {
  imaging::GrayImage indices;
  std::vector<Rgba8> palette;
};

/// PNG with PLTE and tRNS chunks (ISO/IEC 15948). Deterministic.
std::string encode_png(const PaletteImage& image);

}  // namespace tileflight::drawing
