#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "tileflight/core/imaging/image.h"

namespace tileflight::drawing {

/// Scales an image down to at most `width` pixels across by averaging; never scaled up.
imaging::RgbImage downscale(const imaging::RgbImage& image, int width);

/// Reads an image file and returns it scaled down, as a JPEG data URI.
std::string thumbnail_uri(const std::filesystem::path& image, int width);

using Rgba8 = std::array<std::uint8_t, 4>;  ///< red, green, blue, opacity

/// An indexed image of at most 256 colours with opacity. For points on a transparent background, as the page's layers
/// are, the file is a tenth of a full-colour one.
struct PaletteImage {
  imaging::GrayImage indices;
  std::vector<Rgba8> palette;
};

/// Encodes a PNG with PLTE and tRNS chunks (ISO/IEC 15948). Deterministic.
std::string encode_png(const PaletteImage& image);

}  // namespace tileflight::drawing
