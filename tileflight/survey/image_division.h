#pragma once

#include <functional>
#include <optional>
#include <utility>
#include <vector>

#include "tileflight/imaging/pixel_region.h"

namespace tileflight::survey {

/// Halves of a region of an image, across its longer side, bounded as render::CameraRenderer requires; nullopt if it is
/// too small to be divided.
std::optional<std::pair<imaging::PixelRegion, imaging::PixelRegion>> halves_of(const imaging::PixelRegion& region);

/// Divides an image into at least two regions (if it is large enough) that `bytes_of` puts at `budget_bytes` at most,
/// or that are too small to be divided further. They cover the image without overlap; neighbours follow each other.
std::vector<imaging::PixelRegion> divide_image(int width, int height,
                                               const std::function<double(const imaging::PixelRegion&)>& bytes_of,
                                               double budget_bytes);

}  // namespace tileflight::survey
