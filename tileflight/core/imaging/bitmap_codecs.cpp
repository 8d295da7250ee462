// Images that are stored without compression: BMP (Microsoft's BITMAPINFOHEADER) and the PNM family
// (https://netpbm.sourceforge.net/doc/pgm.html, ppm.html).
#include <algorithm>
#include <cstring>
#include <string_view>

#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/raw_bytes.h"
#include "tileflight/core/base/text_parsing.h"
#include "tileflight/core/imaging/codecs.h"

namespace tileflight::imaging::codecs {

namespace {

/// Reads little-endian numbers at places of a file.
class BmpBytes {
 public:
  BmpBytes(std::span<const std::byte> bytes, const std::string& name) : bytes_(bytes), name_(name) {}

  template <class Number>
  Number at(std::size_t place) const {
    Number value{};
    std::memcpy(&value, slice(place, sizeof(Number)).data(), sizeof(Number));
    return value;
  }
  std::span<const std::byte> slice(std::size_t place, std::size_t count) const {
    if (place > bytes_.size() || count > bytes_.size() - place) throw InputError(name_, "the BMP is truncated");
    return bytes_.subspan(place, count);
  }

 private:
  std::span<const std::byte> bytes_;
  const std::string& name_;
};

std::uint8_t value_of(std::byte b) { return std::to_integer<std::uint8_t>(b); }

/// A file's blue, green, red.
Rgb8 rgb_of(std::span<const std::byte> bgr) { return {value_of(bgr[2]), value_of(bgr[1]), value_of(bgr[0])}; }

std::vector<Rgb8> read_palette(const BmpBytes& file, std::size_t header_bytes) {
  const auto stated = file.at<std::uint32_t>(46);
  const std::size_t colors = stated == 0 ? 256 : std::min<std::uint32_t>(stated, 256);
  std::vector<Rgb8> palette(256);
  const std::span<const std::byte> bytes = file.slice(14 + header_bytes, 4 * colors);
  for (std::size_t i = 0; i < colors; ++i) palette[i] = rgb_of(bytes.subspan(4 * i, 3));
  return palette;
}

/// Takes the next number of a PNM header or of its text form; comments begin with '#'.
std::uint32_t take_pnm_number(std::string_view& text, const std::string& name) {
  while (!text.empty() && (text.front() == '#' || std::strchr(" \t\r\n", text.front()) != nullptr)) {
    const std::size_t skipped = text.front() == '#' ? text.find('\n') : 1;
    text.remove_prefix(std::min(skipped, text.size()));
  }
  const std::optional<int> number = base::take_digits(text);
  if (!number) throw InputError(name, "the PNM image is truncated, or its header is damaged");
  return static_cast<std::uint32_t>(*number);
}

/// The samples of a PNM image, row by row, each from 0 to `most`.
std::vector<std::uint16_t> take_pnm_samples(std::string_view text, std::size_t count, bool is_text, std::uint32_t most,
                                            const std::string& name) {
  std::vector<std::uint16_t> samples;
  if (is_text) {
    if (count > text.size()) throw InputError(name, "the PNM image is truncated");  // a digit each at least
    samples.reserve(count);
    while (samples.size() < count)
      samples.push_back(static_cast<std::uint16_t>(std::min(take_pnm_number(text, name), most)));
    return samples;
  }
  if (!text.empty()) text.remove_prefix(1);  // the one blank behind the header
  const std::size_t wide = most > 255 ? 2 : 1;
  if (text.size() / wide < count) throw InputError(name, "the PNM image is truncated");
  samples.reserve(count);
  for (std::size_t i = 0; i < count; ++i) {
    const auto byte = [&](std::size_t k) { return static_cast<std::uint8_t>(text[wide * i + k]); };
    samples.push_back(static_cast<std::uint16_t>(wide == 1 ? byte(0) : 256 * byte(0) + byte(1)));  // big-endian
  }
  return samples;
}

}  // namespace

DecodedImage decode_bmp(std::span<const std::byte> bytes, const std::string& name, const DecodeLimits& limits) {
  const BmpBytes file(bytes, name);
  const std::size_t pixels_at = file.at<std::uint32_t>(10);
  const std::size_t header_bytes = file.at<std::uint32_t>(14);
  if (header_bytes < 40) throw InputError(name, "is a BMP of an early form: save it as PNG");
  const std::int64_t width = file.at<std::int32_t>(18);
  const std::int64_t signed_height = file.at<std::int32_t>(22);
  const std::int64_t height = std::abs(signed_height);
  const std::size_t bits = file.at<std::uint16_t>(28);
  const auto compression = file.at<std::uint32_t>(30);
  check_size(name, width, height, limits);
  const bool is_plain = compression == 0 && (bits == 8 || bits == 24 || bits == 32);
  const bool has_masks = compression == 3 && bits == 32 && file.at<std::uint32_t>(54) == 0x00FF0000U &&
                         file.at<std::uint32_t>(58) == 0x0000FF00U && file.at<std::uint32_t>(62) == 0x000000FFU;
  if (!is_plain && !has_masks)
    throw InputError(name, "is a BMP of " + std::to_string(bits) +
                               " bits that is compressed or has unusual colours: save it as PNG");
  const std::vector<Rgb8> palette = bits == 8 ? read_palette(file, header_bytes) : std::vector<Rgb8>{};
  const std::size_t pixel_bytes = bits / 8;
  const std::size_t row_bytes = (static_cast<std::size_t>(width) * pixel_bytes + 3) / 4 * 4;
  file.slice(pixels_at, row_bytes * static_cast<std::size_t>(height));  // before memory is taken
  DecodedImage out;
  out.rgb = RgbImage(static_cast<int>(width), static_cast<int>(height));
  for (int y = 0; y < out.rgb.height; ++y) {
    const std::size_t stored = static_cast<std::size_t>(signed_height > 0 ? out.rgb.height - 1 - y : y);
    const std::span<const std::byte> row = file.slice(pixels_at + stored * row_bytes, row_bytes);
    for (int x = 0; x < out.rgb.width; ++x) {
      const std::span<const std::byte> pixel = row.subspan(static_cast<std::size_t>(x) * pixel_bytes, pixel_bytes);
      out.rgb(x, y) = bits == 8 ? palette[value_of(pixel[0])] : rgb_of(pixel);
    }
  }
  if (std::ranges::all_of(palette, [](const Rgb8& c) { return c[0] == c[1] && c[1] == c[2]; }) && bits == 8) {
    out.gray = to_gray(out.rgb);
    out.rgb = {};
  }
  return out;
}

DecodedImage decode_pnm(std::span<const std::byte> bytes, const std::string& name, const DecodeLimits& limits) {
  std::string_view text(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  const char kind = text.size() > 1 ? text[1] : '0';
  text.remove_prefix(std::min<std::size_t>(2, text.size()));
  const std::int64_t width = take_pnm_number(text, name), height = take_pnm_number(text, name);
  const std::uint32_t most = take_pnm_number(text, name);
  check_size(name, width, height, limits);
  if (most == 0 || most > 65535) throw InputError(name, "the largest value of the PNM image must be from 1 to 65535");
  const bool is_color = kind == '3' || kind == '6', is_text = kind == '2' || kind == '3';
  const std::size_t pixels = static_cast<std::size_t>(width) * static_cast<std::size_t>(height);
  const std::vector<std::uint16_t> samples = take_pnm_samples(text, pixels * (is_color ? 3 : 1), is_text, most, name);
  const auto to_8_bit = [most](std::uint32_t v) {
    return static_cast<std::uint8_t>((255U * std::min(v, most) + most / 2) / most);
  };
  const int w = static_cast<int>(width), h = static_cast<int>(height);
  DecodedImage out;
  if (is_color) {
    out.rgb = RgbImage(w, h);
    for (std::size_t i = 0; i < pixels; ++i)
      out.rgb.pixels[i] = {to_8_bit(samples[3 * i]), to_8_bit(samples[3 * i + 1]), to_8_bit(samples[3 * i + 2])};
  } else if (most > 255) {
    out.gray16 = Gray16Image(w, h);
    std::ranges::transform(samples, out.gray16.pixels.begin(), [most](std::uint32_t v) {
      return static_cast<std::uint16_t>((65535ULL * std::min(v, most) + most / 2) / most);
    });
  } else {
    out.gray = GrayImage(w, h);
    std::ranges::transform(samples, out.gray.pixels.begin(), to_8_bit);
  }
  return out;
}

}  // namespace tileflight::imaging::codecs
