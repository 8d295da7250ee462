#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "tileflight/core/imaging/image.h"

namespace tileflight::imaging {

/// Writes an OpenEXR file of several 32-bit float channels (lossless ZIP compression). `pixels`: height x width x
/// channels, channels interleaved. Throws InputError (file, cause) if it cannot be written.
void write_exr_channels(const std::filesystem::path& file, int width, int height, std::span<const float> pixels,
                        std::span<const std::string> channels);

/// Overload for an image whose pixels are arrays of channel values.
template <std::size_t N>
void write_exr_channels(const std::filesystem::path& file, const Image<std::array<float, N>>& image,
                        const std::array<std::string, N>& channels) {
  static_assert(sizeof(std::array<float, N>) == N * sizeof(float));
  const float* first = image.pixels.empty() ? nullptr : image.pixels.front().data();
  write_exr_channels(file, image.width, image.height, {first, N * image.pixels.size()}, channels);
}

/// Reads one channel by its name. Throws InputError (file, cause) if it does not exist.
FloatImage read_exr_channel(const std::filesystem::path& file, const std::string& channel);

/// Limits checked before memory is allocated for an untrusted image.
struct DecodeLimits {
  std::int64_t max_pixels = 512LL * 1024 * 1024;
};

/// Returns whether the file's ending is one of the images that are read: .jpg .jpeg .png .webp .tif .tiff .bmp .pgm
/// .ppm .pnm, in any case.
bool is_image_name(const std::filesystem::path& file);

/// Decodes JPEG, PNG (8 and 16 bit, grey, palette, alpha dropped), WebP, TIFF, BMP, PGM or PPM, detected by the first
/// bytes. `name` is used in messages. Throws InputError (name, cause) for truncated, malformed or too large images. A
/// truncated JPEG is an error, not partly grey.
RgbImage decode_rgb(std::span<const std::byte> bytes, const std::string& name, const DecodeLimits& limits = {});
GrayImage decode_gray(std::span<const std::byte> bytes, const std::string& name, const DecodeLimits& limits = {});

/// Re-encodes an image as PNG without loss: 8-bit RGB, 8-bit grey, or 16-bit grey of TIFF and PGM. 16-bit colours
/// become 8 bits. Throws InputError as decode_rgb().
std::vector<std::byte> recode_png(std::span<const std::byte> bytes, const std::string& name,
                                  const DecodeLimits& limits = {});

RgbImage read_rgb(const std::filesystem::path& file, const DecodeLimits& limits = {});
/// Colour files are converted to luma; 16-bit values are scaled to 8 bits.
GrayImage read_gray(const std::filesystem::path& file, const DecodeLimits& limits = {});
Gray16Image read_gray16(const std::filesystem::path& file, const DecodeLimits& limits = {});

/// Encodes a JPEG. `quality` is 1..100 (libjpeg); 4:4:4 chroma from 90 up, otherwise 4:2:0. Deterministic.
std::vector<std::byte> encode_jpeg(const RgbImage& image, int quality);

/// Selects whether a PNG's compression takes its time for a small file or is quick. The pixels are the same.
enum class PngEffort { kSmallFile, kLittleTime };
std::vector<std::byte> encode_png(const RgbImage& image, PngEffort effort = PngEffort::kSmallFile);
std::vector<std::byte> encode_png(const Gray16Image& image);
std::vector<std::byte> encode_png(const GrayImage& image);
/// Encodes an indexed image: `palette` holds at most 256 colours (red, green, blue, opacity).
std::vector<std::byte> encode_png(const GrayImage& indices, std::span<const std::array<std::uint8_t, 4>> palette);

/// Encodes an 8-bit RGBA PNG with alpha 255 everywhere, as AirSim's clients expect. Optimized for speed rather than
/// size: rows are filtered as differences to the row above (filter "up") and deflated in stripes by several threads;
/// the bytes do not depend on the number of threads.
std::vector<std::uint8_t> encode_png_rgba(const RgbImage& image);

/// Encodes an image in less than a tenth of a PNG's time, for temporary files that only this program reads: the
/// differences to the pixels on the left, compressed by Zstandard, behind a mark and the size.
std::vector<std::byte> encode_quick_picture(const RgbImage& image);

/// Decodes what encode_quick_picture() wrote. Throws InputError (name, cause) for anything else.
RgbImage decode_quick_picture(std::span<const std::byte> bytes, const std::string& name);

/// Writes an image in the format of the file extension: .jpg/.jpeg or .png.
void write_rgb(const std::filesystem::path& file, const RgbImage& image, int jpeg_quality = 95);
void write_gray(const std::filesystem::path& file, const GrayImage& image, int jpeg_quality = 95);

/// Writes and reads OpenEXR with one 32-bit float channel (named "Z" for depth along the axis, in metres; lossless ZIP
/// compression).
void write_exr(const std::filesystem::path& file, const FloatImage& image, const std::string& channel = "Z");
FloatImage read_exr(const std::filesystem::path& file);

}  // namespace tileflight::imaging
