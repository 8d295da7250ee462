#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <vector>

#include "tileflight/core/imaging/image.h"

namespace tileflight::imaging {

/// A picture in less than a tenth of a PNG's time, for files that this program alone reads again, soon: the differences
/// to the pixels on the left, compressed by Zstandard, behind a mark and the size.
std::vector<std::byte> encode_quick_picture(const RgbImage& image);

/// The same pixels. Throws InputError (name, cause) for anything else than a whole picture.
RgbImage decode_quick_picture(std::span<const std::byte> bytes, const std::string& name);

}  // namespace tileflight::imaging
