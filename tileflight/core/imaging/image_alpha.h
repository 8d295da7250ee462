#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <string>

#include "tileflight/core/imaging/image.h"
#include "tileflight/core/imaging/image_files.h"

namespace tileflight::imaging {

/// Decodes the opacity of a PNG or WebP, 0 (transparent) to 255 (opaque); empty if the image is opaque. nullopt for
/// formats whose opacity is not read (KTX2). Throws InputError (name, cause): truncated, damaged, larger than the
/// limit.
std::optional<GrayImage> decode_alpha(std::span<const std::byte> bytes, const std::string& name,
                                      const DecodeLimits& limits = {});

}  // namespace tileflight::imaging
