#include "tileflight/core/imaging/image_alpha.h"

#include <png.h>
#include <webp/decode.h>

#include <memory>
#include <vector>

#include "tileflight/core/base/input_error.h"
#include "tileflight/core/imaging/codecs.h"
#include "tileflight/core/imaging/ktx2.h"

namespace tileflight::imaging {
namespace {

/// Every `channels`-th byte, from the last channel of the first pixel.
GrayImage last_channel(const std::vector<std::uint8_t>& pixels, int width, int height, std::size_t channels) {
  GrayImage out(width, height);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      const std::size_t pixel =
          static_cast<std::size_t>(y) * static_cast<std::size_t>(width) + static_cast<std::size_t>(x);
      out(x, y) = pixels[channels * pixel + channels - 1];
    }
  }
  return out;
}

GrayImage png_alpha(std::span<const std::byte> bytes, const std::string& name, const DecodeLimits& limits) {
  png_image image{};
  image.version = PNG_IMAGE_VERSION;
  const std::unique_ptr<png_image, void (*)(png_image*)> release(&image, [](png_image* read) { png_image_free(read); });
  if (png_image_begin_read_from_memory(&image, bytes.data(), bytes.size()) == 0)
    throw InputError(name, "the PNG is truncated or damaged");
  codecs::check_size(name, image.width, image.height, limits);
  if ((image.format & PNG_FORMAT_FLAG_ALPHA) == 0) return {};
  image.format = PNG_FORMAT_GA;
  std::vector<std::uint8_t> pixels(PNG_IMAGE_SIZE(image));
  if (png_image_finish_read(&image, nullptr, pixels.data(), 0, nullptr) == 0)
    throw InputError(name, "the PNG is truncated or damaged");
  return last_channel(pixels, static_cast<int>(image.width), static_cast<int>(image.height), 2);
}

GrayImage webp_alpha(std::span<const std::byte> bytes, const WebPBitstreamFeatures& features, const std::string& name,
                     const DecodeLimits& limits) {
  if (features.has_alpha == 0) return {};
  codecs::check_size(name, features.width, features.height, limits);
  const int stride = 4 * features.width;
  std::vector<std::uint8_t> pixels(static_cast<std::size_t>(stride) * static_cast<std::size_t>(features.height));
  if (WebPDecodeRGBAInto(reinterpret_cast<const std::uint8_t*>(bytes.data()), bytes.size(), pixels.data(),
                         pixels.size(), stride) == nullptr)
    throw InputError(name, "the WebP is truncated or damaged");
  return last_channel(pixels, features.width, features.height, 4);
}

}  // namespace

GrayImage decode_alpha(std::span<const std::byte> bytes, const std::string& name, const DecodeLimits& limits) {
  if (is_ktx2(bytes)) return decode_ktx2_alpha(bytes, name, limits.max_pixels);
  const auto* data = reinterpret_cast<const std::uint8_t*>(bytes.data());
  if (bytes.size() >= 8 && png_sig_cmp(data, 0, 8) == 0) return png_alpha(bytes, name, limits);
  WebPBitstreamFeatures features;
  if (WebPGetFeatures(data, bytes.size(), &features) == VP8_STATUS_OK) return webp_alpha(bytes, features, name, limits);
  return {};
}

}  // namespace tileflight::imaging
