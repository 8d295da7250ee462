#include "tileflight/core/imaging/image_files.h"

#include <algorithm>
#include <array>
#include <cstring>
#include <string_view>

#include "tileflight/core/base/file_kind.h"
#include "tileflight/core/base/files.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/raw_bytes.h"
#include "tileflight/core/base/text_parsing.h"
#include "tileflight/core/imaging/codecs.h"

namespace tileflight::imaging {

namespace codecs {

void check_size(const std::string& name, std::int64_t width, std::int64_t height, const DecodeLimits& limits) {
  if (width > 0 && height > 0 && width <= limits.max_pixels / height) return;
  throw InputError(name, "an image of " + std::to_string(width) + "x" + std::to_string(height) +
                             " pixels is larger than the limit of " + std::to_string(limits.max_pixels) + " pixels");
}

}  // namespace codecs

namespace {

using codecs::DecodedImage;
using codecs::PixelFormat;

bool starts_with(std::span<const std::byte> bytes, std::size_t at, std::string_view magic) {
  return bytes.size() >= at + magic.size() && std::memcmp(bytes.data() + at, magic.data(), magic.size()) == 0;
}

bool is_tiff(std::span<const std::byte> bytes) {
  using namespace std::string_view_literals;
  return starts_with(bytes, 0, "II*\0"sv) || starts_with(bytes, 0, "MM\0*"sv) || starts_with(bytes, 0, "II+\0"sv) ||
         starts_with(bytes, 0, "MM\0+"sv);  // "+": BigTIFF
}

bool is_pnm(std::span<const std::byte> bytes) {
  return starts_with(bytes, 0, "P2") || starts_with(bytes, 0, "P3") || starts_with(bytes, 0, "P5") ||
         starts_with(bytes, 0, "P6");
}

DecodedImage decode(std::span<const std::byte> bytes, const std::string& name, PixelFormat wanted,
                    const DecodeLimits& limits) {
  if (bytes.empty()) throw InputError(name, "is empty, not an image");
  if (starts_with(bytes, 0, "\xFF\xD8")) return codecs::decode_jpeg(bytes, name, wanted, limits);
  if (starts_with(bytes, 0, "\x89PNG")) return codecs::decode_png(bytes, name, wanted, limits);
  if (starts_with(bytes, 0, "RIFF") && starts_with(bytes, 8, "WEBP")) return codecs::decode_webp(bytes, name, limits);
  if (is_tiff(bytes)) return codecs::decode_tiff(bytes, name, limits);
  if (starts_with(bytes, 0, "BM")) return codecs::decode_bmp(bytes, name, limits);
  if (is_pnm(bytes)) return codecs::decode_pnm(bytes, name, limits);
  const std::string expected = "a JPEG, PNG, WebP, TIFF, BMP, PGM or PPM image";
  const auto refusal =
      base::refusal_of_kind(base::as_text(bytes.first(std::min(bytes.size(), base::kHeadBytes))), expected);
  throw InputError(name, refusal.value_or("is not " + expected));
}

Gray16Image widen_to_16_bit(const GrayImage& gray) {
  Gray16Image wide(gray.width, gray.height);
  std::transform(gray.pixels.begin(), gray.pixels.end(), wide.pixels.begin(),
                 [](std::uint8_t value) { return static_cast<std::uint16_t>(value * 257); });
  return wide;
}

GrayImage narrow_to_8_bit(const Gray16Image& wide) {
  GrayImage gray(wide.width, wide.height);
  std::ranges::transform(wide.pixels, gray.pixels.begin(), [](std::uint32_t value) {
    return static_cast<std::uint8_t>((value * 255U + 32767U) / 65535U);
  });
  return gray;
}

GrayImage gray_of(DecodedImage decoded) {
  if (!decoded.rgb.empty()) return to_gray(decoded.rgb);
  return decoded.gray.empty() ? narrow_to_8_bit(decoded.gray16) : std::move(decoded.gray);
}

std::string lower_extension(const std::filesystem::path& file) { return base::to_lower(file.extension().string()); }

bool is_png(const std::filesystem::path& file) {
  const std::string extension = lower_extension(file);
  if (extension == ".png") return true;
  if (extension == ".jpg" || extension == ".jpeg") return false;
  throw InputError(file.string(), "unknown image format (.jpg or .png expected)");
}

}  // namespace

RgbImage decode_rgb(std::span<const std::byte> bytes, const std::string& name, const DecodeLimits& limits) {
  DecodedImage decoded = decode(bytes, name, PixelFormat::kRgb, limits);
  return decoded.rgb.empty() ? to_rgb(gray_of(std::move(decoded))) : std::move(decoded.rgb);
}

GrayImage decode_gray(std::span<const std::byte> bytes, const std::string& name, const DecodeLimits& limits) {
  return gray_of(decode(bytes, name, PixelFormat::kGray, limits));
}

std::vector<std::byte> recode_png(std::span<const std::byte> bytes, const std::string& name,
                                  const DecodeLimits& limits) {
  const DecodedImage decoded = decode(bytes, name, PixelFormat::kRgb, limits);
  if (!decoded.rgb.empty()) return encode_png(decoded.rgb, PngEffort::kLittleTime);
  return decoded.gray16.empty() ? encode_png(decoded.gray) : encode_png(decoded.gray16);
}

bool is_image_name(const std::filesystem::path& file) {
  constexpr std::array kExtensions{".jpg", ".jpeg", ".png", ".webp", ".tif", ".tiff", ".bmp", ".pgm", ".ppm", ".pnm"};
  return std::ranges::find(kExtensions, lower_extension(file)) != kExtensions.end();
}

RgbImage read_rgb(const std::filesystem::path& file, const DecodeLimits& limits) {
  return decode_rgb(base::read_bytes(file), file.string(), limits);
}

GrayImage read_gray(const std::filesystem::path& file, const DecodeLimits& limits) {
  return decode_gray(base::read_bytes(file), file.string(), limits);
}

Gray16Image read_gray16(const std::filesystem::path& file, const DecodeLimits& limits) {
  const std::vector<std::byte> bytes = base::read_bytes(file);
  DecodedImage decoded = decode(bytes, file.string(), PixelFormat::kGray16, limits);
  if (!decoded.gray16.empty()) return std::move(decoded.gray16);
  return widen_to_16_bit(gray_of(std::move(decoded)));
}

std::vector<std::byte> encode_jpeg(const RgbImage& image, int quality) {
  return codecs::encode_jpeg(image.pixels.data()->data(), image.width, image.height, 3, quality);
}

void write_rgb(const std::filesystem::path& file, const RgbImage& image, int jpeg_quality) {
  base::write_file(file, base::as_text(is_png(file) ? encode_png(image) : encode_jpeg(image, jpeg_quality)));
}

void write_gray(const std::filesystem::path& file, const GrayImage& image, int jpeg_quality) {
  base::write_file(file, base::as_text(is_png(file) ? encode_png(image)
                                                    : codecs::encode_jpeg(image.pixels.data(), image.width,
                                                                          image.height, 1, jpeg_quality)));
}

}  // namespace tileflight::imaging
