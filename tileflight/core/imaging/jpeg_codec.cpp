// jpeglib.h needs cstdio before it, jerror.h needs jpeglib.h.
// clang-format off
#include <cstdio>
#include <jpeglib.h>
#include <jerror.h>
// clang-format on

#include <csetjmp>
#include <cstdlib>
#include <cstring>

#include "tileflight/core/base/input_error.h"
#include "tileflight/core/imaging/codecs.h"
#include "tileflight/core/imaging/deferred_texture.h"

namespace tileflight::imaging::codecs {

namespace {

/// libjpeg reports a fatal error through a callback, which jumps (longjmp) to `jump`. The functions that call setjmp
/// hold no object with a destructor, so the jump skips none.
struct ErrorManager {
  jpeg_error_mgr base;
  std::jmp_buf jump;
  char message[JMSG_LENGTH_MAX];
  bool corrupt;
};

ErrorManager* manager_of(j_common_ptr info) { return reinterpret_cast<ErrorManager*>(info->err); }

[[noreturn]] void on_fatal(j_common_ptr info) {
  ErrorManager* manager = manager_of(info);
  info->err->format_message(info, manager->message);
  std::longjmp(manager->jump, 1);
}

/// Whether a warning is harmless. Others mean corrupt data, which libjpeg would fill with grey.
bool is_harmless(int code) {
  return code == JWRN_ADOBE_XFORM || code == JWRN_JFIF_MAJOR || code == JWRN_EXTRANEOUS_DATA ||
         code == JWRN_TOO_MUCH_DATA || code == JWRN_BOGUS_PROGRESSION;
}

void on_message(j_common_ptr info, int level) {
  ErrorManager* manager = manager_of(info);
  if (level >= 0 || manager->corrupt || is_harmless(info->err->msg_code)) return;
  manager->corrupt = true;
  info->err->format_message(info, manager->message);
}

void silent(j_common_ptr /*info*/) {}

void set_up(ErrorManager& manager) {
  jpeg_std_error(&manager.base);
  manager.base.error_exit = on_fatal;
  manager.base.emit_message = on_message;
  manager.base.output_message = silent;
  manager.corrupt = false;
  manager.message[0] = '\0';
}

class Decompressor {
 public:
  explicit Decompressor(std::span<const std::byte> bytes) : bytes_(bytes) {
    std::memset(&info_, 0, sizeof info_);
    set_up(errors_);
    info_.err = &errors_.base;
  }
  ~Decompressor() { jpeg_destroy_decompress(&info_); }
  Decompressor(const Decompressor&) = delete;
  Decompressor& operator=(const Decompressor&) = delete;

  /// Reads the header into info(); false: failed, see message().
  bool read_header() {
    if (setjmp(errors_.jump) != 0) return false;
    jpeg_create_decompress(&info_);
    jpeg_mem_src(&info_, reinterpret_cast<const unsigned char*>(bytes_.data()), bytes_.size());
    jpeg_read_header(&info_, TRUE);
    return true;
  }

  /// Reads all rows, tightly packed.
  bool read_pixels(J_COLOR_SPACE space, std::uint8_t* pixels) {
    if (setjmp(errors_.jump) != 0) return false;
    info_.out_color_space = space;
    info_.dct_method = JDCT_ISLOW;
    jpeg_start_decompress(&info_);
    const std::size_t stride = static_cast<std::size_t>(info_.output_width) * info_.output_components;
    while (info_.output_scanline < info_.output_height && !errors_.corrupt) {
      JSAMPROW row = pixels + stride * info_.output_scanline;
      jpeg_read_scanlines(&info_, &row, 1);
    }
    if (errors_.corrupt) return false;
    jpeg_finish_decompress(&info_);
    return !errors_.corrupt;
  }

  const jpeg_decompress_struct& info() const { return info_; }
  std::string message() const { return errors_.message; }

 private:
  std::span<const std::byte> bytes_;
  jpeg_decompress_struct info_;
  ErrorManager errors_;
};

class Compressor {
 public:
  Compressor() {
    std::memset(&info_, 0, sizeof info_);
    set_up(errors_);
    info_.err = &errors_.base;
  }
  ~Compressor() {
    jpeg_destroy_compress(&info_);
    std::free(buffer_);
  }
  Compressor(const Compressor&) = delete;
  Compressor& operator=(const Compressor&) = delete;

  bool compress(const std::uint8_t* pixels, int width, int height, int channels, int quality) {
    if (setjmp(errors_.jump) != 0) return false;
    jpeg_create_compress(&info_);
    jpeg_mem_dest(&info_, &buffer_, &size_);
    info_.image_width = static_cast<JDIMENSION>(width);
    info_.image_height = static_cast<JDIMENSION>(height);
    info_.input_components = channels;
    info_.in_color_space = channels == 3 ? JCS_RGB : JCS_GRAYSCALE;
    jpeg_set_defaults(&info_);
    jpeg_set_quality(&info_, quality, TRUE);
    info_.dct_method = JDCT_ISLOW;
    if (channels == 3 && quality >= 90)
      info_.comp_info[0].h_samp_factor = info_.comp_info[0].v_samp_factor = 1;  // 4:4:4
    jpeg_start_compress(&info_, TRUE);
    const std::size_t stride = static_cast<std::size_t>(width) * channels;
    while (info_.next_scanline < info_.image_height) {
      JSAMPROW row = const_cast<std::uint8_t*>(pixels) + stride * info_.next_scanline;  // libjpeg does not modify it
      jpeg_write_scanlines(&info_, &row, 1);
    }
    jpeg_finish_compress(&info_);
    return true;
  }

  std::vector<std::byte> bytes() const {
    const auto* begin = reinterpret_cast<const std::byte*>(buffer_);
    return {begin, begin + size_};
  }
  std::string message() const { return errors_.message; }

 private:
  jpeg_compress_struct info_;
  ErrorManager errors_;
  unsigned char* buffer_ = nullptr;
  unsigned long size_ = 0;
};

bool is_convertible(J_COLOR_SPACE space) { return space == JCS_GRAYSCALE || space == JCS_YCbCr || space == JCS_RGB; }

}  // namespace

DecodedImage decode_jpeg(std::span<const std::byte> bytes, const std::string& name, PixelFormat wanted,
                         const DecodeLimits& limits) {
  Decompressor decompressor(bytes);
  if (!decompressor.read_header()) throw InputError(name, "not a readable JPEG: " + decompressor.message());
  const jpeg_decompress_struct& info = decompressor.info();
  check_size(name, info.image_width, info.image_height, limits);
  if (!is_convertible(info.jpeg_color_space))
    throw InputError(name, "CMYK JPEG files are not supported: convert it to RGB");

  const int width = static_cast<int>(info.image_width);
  const int height = static_cast<int>(info.image_height);
  // The luma of a YCbCr file is stored as such: reading it alone needs no conversion.
  const bool gray =
      info.jpeg_color_space == JCS_GRAYSCALE || (wanted != PixelFormat::kRgb && info.jpeg_color_space == JCS_YCbCr);
  DecodedImage out;
  std::uint8_t* pixels = nullptr;
  if (gray) {
    out.gray = GrayImage(width, height);
    pixels = out.gray.pixels.data();
  } else {
    out.rgb = RgbImage(width, height);
    pixels = out.rgb.pixels.data()->data();
  }
  if (!decompressor.read_pixels(gray ? JCS_GRAYSCALE : JCS_RGB, pixels))
    throw InputError(name, "the JPEG is truncated or damaged: " + decompressor.message());
  return out;
}

std::vector<std::byte> encode_jpeg(const std::uint8_t* pixels, int width, int height, int channels, int quality) {
  Compressor compressor;
  if (!compressor.compress(pixels, width, height, channels, quality))
    throw InputError("JPEG of " + std::to_string(width) + "x" + std::to_string(height), compressor.message());
  return compressor.bytes();
}

}  // namespace tileflight::imaging::codecs

namespace tileflight::imaging {

std::optional<std::array<int, 2>> jpeg_size(std::span<const std::byte> bytes) {
  codecs::Decompressor jpeg(bytes);
  if (!jpeg.read_header()) return std::nullopt;
  return std::array{static_cast<int>(jpeg.info().image_width), static_cast<int>(jpeg.info().image_height)};
}

}  // namespace tileflight::imaging
