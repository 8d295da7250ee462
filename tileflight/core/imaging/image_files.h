#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "tileflight/core/imaging/image.h"

namespace tileflight::imaging {

/// Limits checked before memory is allocated for an untrusted image.
struct DecodeLimits {
  std::int64_t max_pixels = 512LL * 1024 * 1024;
};

/// Decodes JPEG, PNG (8 and 16 bit, grey, palette, alpha dropped) or WebP, detected by the first bytes. `name` is used
/// in messages. Throws InputError (name, cause) for truncated, malformed or too large images. A truncated JPEG is an
/// error, not partly grey.
RgbImage decode_rgb(std::span<const std::byte> bytes, const std::string& name, const DecodeLimits& limits = {});
GrayImage decode_gray(std::span<const std::byte> bytes, const std::string& name, const DecodeLimits& limits = {});

RgbImage read_rgb(const std::filesystem::path& file, const DecodeLimits& limits = {});
/// Colour files are converted to luma; 16-bit values are scaled to 8 bits.
GrayImage read_gray(const std::filesystem::path& file, const DecodeLimits& limits = {});
Gray16Image read_gray16(const std::filesystem::path& file, const DecodeLimits& limits = {});

/// `quality` 1..100 (libjpeg); 4:4:4 chroma from 90 up, otherwise 4:2:0. Deterministic.
std::vector<std::byte> encode_jpeg(const RgbImage& image, int quality);

/// What a PNG's compression is to spend: time for a small file, or little time. The pixels are the same.
enum class PngEffort { kSmallFile, kLittleTime };
std::vector<std::byte> encode_png(const RgbImage& image, PngEffort effort = PngEffort::kSmallFile);
std::vector<std::byte> encode_png(const Gray16Image& image);
std::vector<std::byte> encode_png(const GrayImage& image);

/// Format by the file extension: .jpg/.jpeg (quality 95) or .png.
void write_rgb(const std::filesystem::path& file, const RgbImage& image, int jpeg_quality = 95);
void write_gray(const std::filesystem::path& file, const GrayImage& image, int jpeg_quality = 95);

/// OpenEXR, one 32-bit float channel (named "Z" for depth along the axis, in metres; lossless ZIP compression).
void write_exr(const std::filesystem::path& file, const FloatImage& image, const std::string& channel = "Z");
FloatImage read_exr(const std::filesystem::path& file);

}  // namespace tileflight::imaging
