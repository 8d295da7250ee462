#pragma once

#include <cstddef>
#include <span>
#include <string>

#include "tileflight/core/imaging/image.h"
#include "tileflight/core/imaging/image_files.h"

namespace tileflight::imaging {

/// Decodes the opacity of a PNG, WebP or KTX2, 0 (transparent) to 255 (opaque); empty if the image has none. Throws
/// InputError (name, cause): truncated, damaged, larger than the limit.
GrayImage decode_alpha(std::span<const std::byte> bytes, const std::string& name, const DecodeLimits& limits = {});

}  // namespace tileflight::imaging
