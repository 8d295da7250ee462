#include <webp/decode.h>

#include "tileflight/core/base/input_error.h"
#include "tileflight/core/imaging/codecs.h"

namespace tileflight::imaging::codecs {

DecodedImage decode_webp(std::span<const std::byte> bytes, const std::string& name, const DecodeLimits& limits) {
  const auto* data = reinterpret_cast<const std::uint8_t*>(bytes.data());
  WebPBitstreamFeatures features;
  if (WebPGetFeatures(data, bytes.size(), &features) != VP8_STATUS_OK) throw InputError(name, "not a readable WebP");
  if (features.has_animation != 0) throw InputError(name, "animated WebP is not supported: extract a single frame");
  check_size(name, features.width, features.height, limits);
  DecodedImage out;
  out.rgb = RgbImage(features.width, features.height);
  const std::size_t stride = out.rgb.pixels.size() / features.height * sizeof(Rgb8);
  if (WebPDecodeRGBInto(data, bytes.size(), out.rgb.pixels.data()->data(), stride * features.height,
                        static_cast<int>(stride)) == nullptr)
    throw InputError(name, "the WebP is truncated or damaged");
  return out;
}

}  // namespace tileflight::imaging::codecs
