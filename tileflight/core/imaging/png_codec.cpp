#include <png.h>

#include <csetjmp>
#include <cstring>

#include "tileflight/core/base/input_error.h"
#include "tileflight/core/imaging/codecs.h"

namespace tileflight::imaging {

namespace {

/// libpng reports errors through a callback, which jumps (longjmp) to `jump`. The functions that call setjmp hold no
/// object with a destructor, so the jump skips none.
struct Fault {
  std::jmp_buf jump;
  char message[256] = "";
};

[[noreturn]] void on_error(png_structp png, png_const_charp message) {
  auto* fault = static_cast<Fault*>(png_get_error_ptr(png));
  std::strncpy(fault->message, message, sizeof fault->message - 1);
  std::longjmp(fault->jump, 1);
}

void on_warning(png_structp /*png*/, png_const_charp /*message*/) {}

class Reader {
 public:
  explicit Reader(std::span<const std::byte> bytes) : rest_(bytes) {
    png_ = png_create_read_struct(PNG_LIBPNG_VER_STRING, &fault_, on_error, on_warning);
    info_ = png_create_info_struct(png_);
  }
  ~Reader() { png_destroy_read_struct(&png_, &info_, nullptr); }
  Reader(const Reader&) = delete;
  Reader& operator=(const Reader&) = delete;

  bool read_header() {
    if (setjmp(fault_.jump) != 0) return false;
    png_set_read_fn(png_, this, [](png_structp png, png_bytep to, png_size_t count) {
      static_cast<Reader*>(png_get_io_ptr(png))->take(to, count);
    });
    png_read_info(png_, info_);
    return true;
  }

  std::int64_t width() const { return png_get_image_width(png_, info_); }
  std::int64_t height() const { return png_get_image_height(png_, info_); }
  bool is_gray() const {
    return (png_get_color_type(png_, info_) & (PNG_COLOR_MASK_COLOR | PNG_COLOR_MASK_PALETTE)) == 0;
  }
  bool is_16_bit() const { return png_get_bit_depth(png_, info_) == 16; }

  /// Reads rows into `rows` (one pointer per row): 8 bits a sample, or 16 in native byte order.
  bool read_pixels(bool keep_16_bit, png_bytepp rows) {
    if (setjmp(fault_.jump) != 0) return false;
    png_set_expand(png_);  // palette to RGB, 1, 2, 4 bits to 8, transparency to alpha
    png_set_strip_alpha(png_);
    if (keep_16_bit)
      png_set_swap(png_);
    else
      png_set_scale_16(png_);
    png_set_interlace_handling(png_);
    png_read_update_info(png_, info_);
    png_read_image(png_, rows);
    png_read_end(png_, nullptr);
    return true;
  }

  std::string message() const { return fault_.message; }

 private:
  void take(png_bytep to, png_size_t count) {
    if (count > rest_.size()) png_error(png_, "the file ends early");
    std::memcpy(to, rest_.data(), count);
    rest_ = rest_.subspan(count);
  }

  std::span<const std::byte> rest_;
  Fault fault_;
  png_structp png_ = nullptr;
  png_infop info_ = nullptr;
};

template <class Pixel>
std::vector<png_bytep> row_pointers(Image<Pixel>& image) {
  std::vector<png_bytep> rows;
  for (int y = 0; y < image.height; ++y) rows.push_back(reinterpret_cast<png_bytep>(image.row(y)));
  return rows;
}

template <class Pixel>
Image<Pixel> read_into(Reader& reader, bool keep_16_bit, const std::string& name) {
  Image<Pixel> image(static_cast<int>(reader.width()), static_cast<int>(reader.height()));
  std::vector<png_bytep> rows = row_pointers(image);
  if (!reader.read_pixels(keep_16_bit, rows.data()))
    throw InputError(name, "the PNG is truncated or damaged: " + reader.message());
  return image;
}

/// Rec. 601 luma at 16 bits a channel.
Gray16Image luma16(const Image<std::array<std::uint16_t, 3>>& rgb) {
  Gray16Image gray(rgb.width, rgb.height);
  for (std::size_t i = 0; i < rgb.pixels.size(); ++i) {
    const auto [r, g, b] = rgb.pixels[i];
    gray.pixels[i] = static_cast<std::uint16_t>((299U * r + 587U * g + 114U * b + 500U) / 1000U);
  }
  return gray;
}

struct Palette {
  std::vector<png_color> colors;
  std::vector<png_byte> opacity;
};

class Writer {
 public:
  Writer() {
    png_ = png_create_write_struct(PNG_LIBPNG_VER_STRING, &fault_, on_error, on_warning);
    info_ = png_create_info_struct(png_);
  }
  ~Writer() { png_destroy_write_struct(&png_, &info_); }
  Writer(const Writer&) = delete;
  Writer& operator=(const Writer&) = delete;

  bool write(int width, int height, int bits, int color_type, PngEffort effort, png_bytepp rows,
             const Palette& palette = {}) {
    if (setjmp(fault_.jump) != 0) return false;
    png_set_write_fn(
        png_, this,
        [](png_structp png, png_bytep from, png_size_t count) {
          const auto* begin = reinterpret_cast<const std::byte*>(from);
          auto& to = static_cast<Writer*>(png_get_io_ptr(png))->bytes_;
          to.insert(to.end(), begin, begin + count);
        },
        [](png_structp) {});
    png_set_IHDR(png_, info_, static_cast<png_uint_32>(width), static_cast<png_uint_32>(height), bits, color_type,
                 PNG_INTERLACE_NONE, PNG_COMPRESSION_TYPE_DEFAULT, PNG_FILTER_TYPE_DEFAULT);
    png_set_compression_level(png_, effort == PngEffort::kSmallFile ? 6 : 1);
    // One filter for all rows: to try five on each takes longer than the fastest compression does.
    if (effort == PngEffort::kLittleTime) png_set_filter(png_, PNG_FILTER_TYPE_BASE, PNG_FILTER_SUB);
    if (!palette.colors.empty()) {
      const int count = static_cast<int>(palette.colors.size());
      png_set_PLTE(png_, info_, palette.colors.data(), count);
      png_set_tRNS(png_, info_, palette.opacity.data(), count, nullptr);
    }
    png_write_info(png_, info_);
    if (bits == 16) png_set_swap(png_);
    png_write_image(png_, rows);
    png_write_end(png_, nullptr);
    return true;
  }

  std::vector<std::byte> take_bytes() { return std::move(bytes_); }
  std::string message() const { return fault_.message; }

 private:
  Fault fault_;
  png_structp png_ = nullptr;
  png_infop info_ = nullptr;
  std::vector<std::byte> bytes_;
};

template <class Pixel>
std::vector<std::byte> encode(const Image<Pixel>& image, int bits, int color_type,
                              PngEffort effort = PngEffort::kSmallFile, const Palette& palette = {}) {
  std::vector<png_bytep> rows = row_pointers(const_cast<Image<Pixel>&>(image));  // libpng does not modify it
  Writer writer;
  if (!writer.write(image.width, image.height, bits, color_type, effort, rows.data(), palette))
    throw InputError("PNG of " + std::to_string(image.width) + "x" + std::to_string(image.height), writer.message());
  return writer.take_bytes();
}

}  // namespace

namespace codecs {

DecodedImage decode_png(std::span<const std::byte> bytes, const std::string& name, PixelFormat wanted,
                        const DecodeLimits& limits) {
  Reader reader(bytes);
  if (!reader.read_header()) throw InputError(name, "not a readable PNG: " + reader.message());
  check_size(name, reader.width(), reader.height(), limits);
  const bool keep_16_bit = wanted == PixelFormat::kGray16 && reader.is_16_bit();
  DecodedImage out;
  if (keep_16_bit && reader.is_gray())
    out.gray16 = read_into<std::uint16_t>(reader, true, name);
  else if (keep_16_bit)
    out.gray16 = luma16(read_into<std::array<std::uint16_t, 3>>(reader, true, name));
  else if (reader.is_gray())
    out.gray = read_into<std::uint8_t>(reader, false, name);
  else
    out.rgb = read_into<Rgb8>(reader, false, name);
  return out;
}

}  // namespace codecs

std::vector<std::byte> encode_png(const RgbImage& image, PngEffort effort) {
  return encode(image, 8, PNG_COLOR_TYPE_RGB, effort);
}
std::vector<std::byte> encode_png(const Gray16Image& image) { return encode(image, 16, PNG_COLOR_TYPE_GRAY); }
std::vector<std::byte> encode_png(const GrayImage& image) { return encode(image, 8, PNG_COLOR_TYPE_GRAY); }
std::vector<std::byte> encode_png(const GrayImage& indices, std::span<const std::array<std::uint8_t, 4>> palette) {
  Palette entries;
  for (const auto& [red, green, blue, opacity] : palette) {
    entries.colors.push_back({red, green, blue});
    entries.opacity.push_back(opacity);
  }
  return encode(indices, 8, PNG_COLOR_TYPE_PALETTE, PngEffort::kSmallFile, entries);
}

}  // namespace tileflight::imaging
