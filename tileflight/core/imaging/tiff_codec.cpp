#include <tiffio.h>

#include <algorithm>
#include <cstring>
#include <memory>

#include "tileflight/core/base/input_error.h"
#include "tileflight/core/imaging/codecs.h"

namespace tileflight::imaging::codecs {

namespace {

/// A file in memory, for libtiff's callbacks.
struct TiffBytes {
  std::span<const std::byte> bytes;
  std::uint64_t at = 0;
  std::string fault;
};

tmsize_t read_tiff(thandle_t handle, void* to, tmsize_t count) {
  auto& file = *static_cast<TiffBytes*>(handle);
  if (count <= 0 || file.at >= file.bytes.size()) return 0;
  const std::size_t taken = std::min(static_cast<std::size_t>(count), file.bytes.size() - file.at);
  std::memcpy(to, file.bytes.data() + file.at, taken);
  file.at += taken;
  return static_cast<tmsize_t>(taken);
}
tmsize_t write_tiff(thandle_t /*handle*/, void* /*from*/, tmsize_t /*count*/) { return 0; }
toff_t seek_tiff(thandle_t handle, toff_t offset, int whence) {
  auto& file = *static_cast<TiffBytes*>(handle);
  const std::uint64_t base = whence == SEEK_SET ? 0 : whence == SEEK_CUR ? file.at : file.bytes.size();
  file.at = base + offset;
  return file.at;
}
int close_tiff(thandle_t /*handle*/) { return 0; }
toff_t size_tiff(thandle_t handle) { return static_cast<TiffBytes*>(handle)->bytes.size(); }

int keep_fault(TIFF* /*tiff*/, void* user, const char* /*module*/, const char* format, va_list arguments) {
  char text[200];
  std::vsnprintf(text, sizeof text, format, arguments);
  static_cast<TiffBytes*>(user)->fault = text;
  return 1;
}
int ignore_warning(TIFF* /*tiff*/, void* /*user*/, const char* /*module*/, const char* /*format*/,
                   va_list /*arguments*/) {
  return 1;
}

using OpenTiff = std::unique_ptr<TIFF, decltype(&TIFFClose)>;

OpenTiff open_tiff(TiffBytes& file, const std::string& name) {
  constexpr tmsize_t kMostMemory = tmsize_t{1} << 32;
  const std::unique_ptr<TIFFOpenOptions, decltype(&TIFFOpenOptionsFree)> options(TIFFOpenOptionsAlloc(),
                                                                                 &TIFFOpenOptionsFree);
  TIFFOpenOptionsSetMaxSingleMemAlloc(options.get(), kMostMemory);
  TIFFOpenOptionsSetErrorHandlerExtR(options.get(), keep_fault, &file);
  TIFFOpenOptionsSetWarningHandlerExtR(options.get(), ignore_warning, nullptr);
  // "m": no memory mapping
  OpenTiff tiff(TIFFClientOpenExt(name.c_str(), "rm", &file, read_tiff, write_tiff, seek_tiff, close_tiff, size_tiff,
                                  nullptr, nullptr, options.get()),
                &TIFFClose);
  if (!tiff) throw InputError(name, "not a readable TIFF: " + file.fault);
  return tiff;
}

template <class Value>
Value tag_or(TIFF* tiff, std::uint32_t tag, Value other) {
  Value value = other;
  return TIFFGetFieldDefaulted(tiff, tag, &value) == 1 ? value : other;
}

InputError damaged(const TiffBytes& file, const std::string& name) {
  return {name, "the TIFF is truncated or damaged" + (file.fault.empty() ? "" : ": " + file.fault)};
}

/// The samples of a 16-bit grey image in rows.
Gray16Image read_gray16_rows(TIFF* tiff, int width, int height, const TiffBytes& file, const std::string& name) {
  Gray16Image image(width, height);
  const auto row_bytes = static_cast<std::size_t>(TIFFScanlineSize(tiff));
  if (row_bytes < 2 * static_cast<std::size_t>(width)) throw damaged(file, name);
  std::vector<std::uint16_t> row(row_bytes / 2 + 1);
  for (int y = 0; y < height; ++y) {
    if (TIFFReadScanline(tiff, row.data(), static_cast<std::uint32_t>(y)) != 1) throw damaged(file, name);
    std::copy_n(row.begin(), width, image.row(y));
  }
  return image;
}

RgbImage read_rgb_raster(TIFF* tiff, int width, int height, const TiffBytes& file, const std::string& name) {
  std::vector<std::uint32_t> raster(static_cast<std::size_t>(width) * static_cast<std::size_t>(height));
  // The pixels as stored, as of a photo with a rotation flag.
  const int stored = tag_or<std::uint16_t>(tiff, TIFFTAG_ORIENTATION, ORIENTATION_TOPLEFT);
  if (TIFFReadRGBAImageOriented(tiff, static_cast<std::uint32_t>(width), static_cast<std::uint32_t>(height),
                                raster.data(), stored, 1) != 1)
    throw damaged(file, name);
  RgbImage image(width, height);
  std::ranges::transform(raster, image.pixels.begin(), [](std::uint32_t pixel) {
    return Rgb8{static_cast<std::uint8_t>(TIFFGetR(pixel)), static_cast<std::uint8_t>(TIFFGetG(pixel)),
                static_cast<std::uint8_t>(TIFFGetB(pixel))};
  });
  return image;
}

}  // namespace

DecodedImage decode_tiff(std::span<const std::byte> bytes, const std::string& name, const DecodeLimits& limits) {
  TiffBytes file{bytes, 0, {}};
  const OpenTiff tiff = open_tiff(file, name);
  const auto width = tag_or<std::uint32_t>(tiff.get(), TIFFTAG_IMAGEWIDTH, 0);
  const auto height = tag_or<std::uint32_t>(tiff.get(), TIFFTAG_IMAGELENGTH, 0);
  check_size(name, width, height, limits);
  const auto bits = tag_or<std::uint16_t>(tiff.get(), TIFFTAG_BITSPERSAMPLE, 1);
  const auto samples = tag_or<std::uint16_t>(tiff.get(), TIFFTAG_SAMPLESPERPIXEL, 1);
  const auto kind = tag_or<std::uint16_t>(tiff.get(), TIFFTAG_SAMPLEFORMAT, SAMPLEFORMAT_UINT);
  const auto photometric = tag_or<std::uint16_t>(tiff.get(), TIFFTAG_PHOTOMETRIC, PHOTOMETRIC_MINISBLACK);
  if (kind != SAMPLEFORMAT_UINT || bits > 16)
    throw InputError(name,
                     "is a TIFF of " + std::to_string(bits) +
                         "-bit numbers, not an image of 8 or 16 bits: convert it (gdal_translate -ot UInt16 -scale)");
  const bool is_gray = samples == 1 && (photometric == PHOTOMETRIC_MINISBLACK || photometric == PHOTOMETRIC_MINISWHITE);
  const int w = static_cast<int>(width), h = static_cast<int>(height);
  DecodedImage out;
  if (is_gray && bits == 16 && photometric == PHOTOMETRIC_MINISBLACK && TIFFIsTiled(tiff.get()) == 0) {
    out.gray16 = read_gray16_rows(tiff.get(), w, h, file, name);
    return out;
  }
  RgbImage raster = read_rgb_raster(tiff.get(), w, h, file, name);
  if (is_gray)
    out.gray = to_gray(raster);
  else
    out.rgb = std::move(raster);
  return out;
}

}  // namespace tileflight::imaging::codecs
