#include "tileflight/core/drawing/page_image.h"

#include <png.h>

#include <cassert>
#include <cstdlib>

namespace tileflight::drawing {
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
