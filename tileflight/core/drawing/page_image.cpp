#include "tileflight/core/drawing/page_image.h"

#include <png.h>

#include <algorithm>
#include <array>
#include <cassert>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <vector>

#include "tileflight/core/drawing/html.h"
#include "tileflight/core/imaging/image_files.h"

namespace tileflight::drawing {

namespace {

constexpr int kJpegQuality = 82;

}  // namespace

imaging::RgbImage downscale(const imaging::RgbImage& image, int width) {
  if (image.width <= width) return image;
  const int height =
      std::max(1, static_cast<int>(std::lround(static_cast<double>(image.height) * width / image.width)));
  imaging::RgbImage result(width, height);
  for (int y = 0; y < height; ++y) {
    const int top = static_cast<int>(std::int64_t{y} * image.height / height);
    const int bottom = std::max(top + 1, static_cast<int>((std::int64_t{y} + 1) * image.height / height));
    for (int x = 0; x < width; ++x) {
      const int left = static_cast<int>(std::int64_t{x} * image.width / width);
      const int right = std::max(left + 1, static_cast<int>((std::int64_t{x} + 1) * image.width / width));
      std::array<int, 3> sum{};
      for (int v = top; v < bottom; ++v) {
        for (int u = left; u < right; ++u) {
          for (std::size_t c = 0; c < 3; ++c) sum[c] += image(u, v)[c];
        }
      }
      const int area = (bottom - top) * (right - left);
      for (std::size_t c = 0; c < 3; ++c) result(x, y)[c] = static_cast<std::uint8_t>((sum[c] + area / 2) / area);
    }
  }
  return result;
}

std::string thumbnail_uri(const std::filesystem::path& image, int width) {
  const std::vector<std::byte> jpeg = imaging::encode_jpeg(downscale(imaging::read_rgb(image), width), kJpegQuality);
  return data_uri("image/jpeg", {reinterpret_cast<const char*>(jpeg.data()), jpeg.size()});
}

namespace {

struct Encoder {
  png_structp png = nullptr;
  png_infop info = nullptr;
  Encoder() {
    // It writes this program's own data to memory: an error here is a bug.
    png = png_create_write_struct(
        PNG_LIBPNG_VER_STRING, nullptr, [](png_structp, png_const_charp) { std::abort(); }, nullptr);
    info = png_create_info_struct(png);
  }
  ~Encoder() { png_destroy_write_struct(&png, &info); }
  Encoder(const Encoder&) = delete;
  Encoder& operator=(const Encoder&) = delete;
};

void append(png_structp png, png_bytep bytes, png_size_t size) {
  static_cast<std::string*>(png_get_io_ptr(png))->append(reinterpret_cast<const char*>(bytes), size);
}

void set_palette(Encoder& encoder, const std::vector<Rgba8>& palette) {
  std::vector<png_color> colors;
  std::vector<png_byte> opacity;
  for (const Rgba8& c : palette) {
    colors.push_back({c[0], c[1], c[2]});
    opacity.push_back(c[3]);
  }
  png_set_PLTE(encoder.png, encoder.info, colors.data(), static_cast<int>(colors.size()));
  png_set_tRNS(encoder.png, encoder.info, opacity.data(), static_cast<int>(opacity.size()), nullptr);
}

}  // namespace

std::string encode_png(const PaletteImage& image) {
  assert(!image.indices.empty() && !image.palette.empty() && image.palette.size() <= 256);
  std::string bytes;
  Encoder encoder;
  png_set_write_fn(encoder.png, &bytes, append, nullptr);
  png_set_IHDR(encoder.png, encoder.info, static_cast<png_uint_32>(image.indices.width),
               static_cast<png_uint_32>(image.indices.height), 8, PNG_COLOR_TYPE_PALETTE, PNG_INTERLACE_NONE,
               PNG_COMPRESSION_TYPE_DEFAULT, PNG_FILTER_TYPE_DEFAULT);
  set_palette(encoder, image.palette);
  png_write_info(encoder.png, encoder.info);
  for (int y = 0; y < image.indices.height; ++y) png_write_row(encoder.png, image.indices.row(y));
  png_write_end(encoder.png, encoder.info);
  return bytes;
}

}  // namespace tileflight::drawing
