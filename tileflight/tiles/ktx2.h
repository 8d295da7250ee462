#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>

#include "tileflight/imaging/image.h"

namespace tileflight::tiles {

/// Whether the bytes are a KTX2 file.
bool is_ktx2(std::span<const std::byte> bytes);

/// One level of a KTX2 texture, 0 the finest (KTX File Format Specification 2.0) as KHR_texture_basisu has it: ETC1S
/// with BasisLZ, or UASTC. Also 8-bit RGB and RGBA. All but ETC1S plain or in Zstandard. Alpha is dropped. Throws
/// InputError (name, cause): malformed, larger than `max_pixels`, in a format that is not read (named).
imaging::RgbImage decode_ktx2(std::span<const std::byte> bytes, const std::string& name, std::int64_t max_pixels,
                              std::uint32_t level = 0);

/// A KTX2, or whatever imaging::decode_rgb reads.
imaging::RgbImage decode_texture(std::span<const std::byte> bytes, const std::string& name, std::int64_t max_pixels);

}  // namespace tileflight::tiles
