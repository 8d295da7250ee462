#pragma once

#include <filesystem>
#include <string>

#include "tileflight/core/imaging/image.h"

namespace tileflight::drawing {

/// The image scaled down to at most `width` pixels across by averaging; never scaled up.
imaging::RgbImage downscale(const imaging::RgbImage& image, int width);

/// The image file scaled down, as a JPEG data URI.
std::string thumbnail_uri(const std::filesystem::path& image, int width);

}  // namespace tileflight::drawing
