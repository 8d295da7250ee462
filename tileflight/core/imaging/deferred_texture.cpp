#include "tileflight/core/imaging/deferred_texture.h"

#include <cassert>
#include <utility>

namespace tileflight::imaging {
namespace {

/// Frees the stand-in of a deferred texture. It travels with the pointer, so it holds the means to decode, too.
struct DeferredDeleter {
  std::function<RgbImage()> decode;

  void operator()(const RgbImage* stand_in) const { delete stand_in; }
};

}  // namespace

std::shared_ptr<const RgbImage> make_deferred_texture(int width, int height, std::function<RgbImage()> decode) {
  auto stand_in = std::make_unique<RgbImage>();
  stand_in->width = width;
  stand_in->height = height;
  return {stand_in.release(), DeferredDeleter{std::move(decode)}};
}

bool is_deferred(const std::shared_ptr<const RgbImage>& texture) {
  return std::get_deleter<DeferredDeleter>(texture) != nullptr;
}

std::shared_ptr<const RgbImage> with_pixels(const std::shared_ptr<const RgbImage>& texture) {
  const auto* deferred = std::get_deleter<DeferredDeleter>(texture);
  if (deferred == nullptr) return texture;
  auto image = std::make_shared<const RgbImage>(deferred->decode());
  assert(image->width == texture->width && image->height == texture->height);
  return image;
}

}  // namespace tileflight::imaging
