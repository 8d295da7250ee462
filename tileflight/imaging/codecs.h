#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <vector>

#include "tileflight/imaging/image.h"
#include "tileflight/imaging/image_files.h"

/// One file each for libjpeg, libpng and libwebp; image_files.cpp chooses between them. All throw InputError (name,
/// cause).
namespace tileflight::imaging::codecs {

/// What a caller takes from a file: grey files are given as grey, whatever was asked for.
struct Decoded {
  RgbImage rgb;  ///< empty where the file is grey or grey was asked for and the codec has it
  GrayImage gray;
  Gray16Image gray16;  ///< 16-bit grey PNG when asked for
};

enum class Wanted { kRgb, kGray, kGray16 };

/// Throws InputError unless 0 < width x height <= limits.max_pixels.
void check_size(const std::string& name, std::int64_t width, std::int64_t height, const DecodeLimits& limits);

Decoded decode_jpeg(std::span<const std::byte> bytes, const std::string& name, Wanted wanted,
                    const DecodeLimits& limits);
Decoded decode_png(std::span<const std::byte> bytes, const std::string& name, Wanted wanted,
                   const DecodeLimits& limits);
Decoded decode_webp(std::span<const std::byte> bytes, const std::string& name, const DecodeLimits& limits);

/// `channels` 1 or 3, rows without padding.
std::vector<std::byte> encode_jpeg(const std::uint8_t* pixels, int width, int height, int channels, int quality);

}  // namespace tileflight::imaging::codecs
