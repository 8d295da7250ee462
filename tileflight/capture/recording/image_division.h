#pragma once

#include <functional>
#include <optional>
#include <utility>
#include <vector>

#include "tileflight/core/imaging/image.h"

namespace tileflight::recording {

/// Memory that a region's tiles take, bytes.
using RegionBytes = std::function<double(const imaging::PixelRegion&)>;

/// Two halves of a region of an image, bounded as render::CameraRenderer requires: side by side or one above the other,
/// whichever takes less memory in all. (At the horizon, where a row shows tiles at every distance, they lie side by
/// side.) nullopt if it is too small to be divided.
std::optional<std::pair<imaging::PixelRegion, imaging::PixelRegion>> halves_of(const imaging::PixelRegion& region,
                                                                               const RegionBytes& bytes_of);

/// Divides an image into at least two regions (if it is large enough) that keep within the budget, or that are too
/// small to be divided further. They cover the image without overlap; neighbours follow each other.
std::vector<imaging::PixelRegion> divide_image(int width, int height, const RegionBytes& bytes_of, double budget_bytes);

}  // namespace tileflight::recording
