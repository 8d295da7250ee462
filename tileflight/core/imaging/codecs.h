#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <vector>

#include "tileflight/core/imaging/image.h"
#include "tileflight/core/imaging/image_files.h"

/// One file each for libjpeg, libpng, libwebp, libtiff and what is not compressed; image_files.cpp selects the codec.
/// All throw InputError (name, cause).
namespace tileflight::imaging::codecs {

/// Decoded pixels: grey files are returned as grey, whatever format was requested.
struct DecodedImage {
  RgbImage rgb;  ///< empty if the file is grey, or if grey was requested and the codec can produce it
  GrayImage gray;
  Gray16Image gray16;  ///< 16-bit grey: of a PNG if requested, of TIFF and PGM always, in place of `gray`
};

enum class PixelFormat { kRgb, kGray, kGray16 };

/// Throws InputError unless 0 < width x height <= limits.max_pixels.
void check_size(const std::string& name, std::int64_t width, std::int64_t height, const DecodeLimits& limits);

DecodedImage decode_jpeg(std::span<const std::byte> bytes, const std::string& name, PixelFormat wanted,
                         const DecodeLimits& limits);
DecodedImage decode_png(std::span<const std::byte> bytes, const std::string& name, PixelFormat wanted,
                        const DecodeLimits& limits);
DecodedImage decode_webp(std::span<const std::byte> bytes, const std::string& name, const DecodeLimits& limits);

/// TIFF of 1 to 16 bits, the first image of the file; as stored, whatever orientation it states.
DecodedImage decode_tiff(std::span<const std::byte> bytes, const std::string& name, const DecodeLimits& limits);
/// BMP of 8 bits with a palette, 24 or 32 bits, not compressed.
DecodedImage decode_bmp(std::span<const std::byte> bytes, const std::string& name, const DecodeLimits& limits);
/// PGM and PPM, binary or text (P2, P3, P5, P6); values are scaled from the file's largest value to 255 or 65535.
DecodedImage decode_pnm(std::span<const std::byte> bytes, const std::string& name, const DecodeLimits& limits);

/// `channels` 1 or 3, rows without padding.
std::vector<std::byte> encode_jpeg(const std::uint8_t* pixels, int width, int height, int channels, int quality);

}  // namespace tileflight::imaging::codecs
