#pragma once

#include <array>
#include <cstddef>
#include <functional>
#include <memory>
#include <optional>
#include <span>

#include "tileflight/core/imaging/image.h"

namespace tileflight::imaging {

/// Returns a texture that has its size and no pixels: with_pixels() decodes them. A place has thousands of textures, of
/// which a few are used at a time. `decode` may be called from several threads, and must return an image of this size.
std::shared_ptr<const RgbImage> make_deferred_texture(int width, int height, std::function<RgbImage()> decode);

/// Tells whether with_pixels() decodes the texture.
bool is_deferred(const std::shared_ptr<const RgbImage>& texture);

/// Returns the texture itself, or the image that a deferred one decodes, anew at each call. Throws what `decode` does.
std::shared_ptr<const RgbImage> with_pixels(const std::shared_ptr<const RgbImage>& texture);

/// Returns width and height as a JPEG states them, without decoding it; nullopt for anything else.
std::optional<std::array<int, 2>> jpeg_size(std::span<const std::byte> bytes);

}  // namespace tileflight::imaging
