#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>

#include "tileflight/core/imaging/image.h"

namespace tileflight::imaging {

/// Whether the bytes are a KTX2 file.
bool is_ktx2(std::span<const std::byte> bytes);

/// Decodes one level, 0 the finest, of a KTX2 texture (KTX File Format Specification 2.0) as used by
/// KHR_texture_basisu: ETC1S with BasisLZ, or UASTC; also 8-bit RGB and RGBA. All formats but ETC1S may be uncompressed
/// or Zstandard-compressed. Alpha is left to decode_ktx2_alpha(). Throws InputError (name, cause): malformed, larger
/// than `max_pixels`, an unsupported format (named).
RgbImage decode_ktx2(std::span<const std::byte> bytes, const std::string& name, std::int64_t max_pixels,
                     std::uint32_t level = 0);

/// Decodes the opacity of the finest level, 0 (transparent) to 255 (opaque); empty if the texture has no alpha. A
/// second channel that the texture's descriptor names otherwise (of normal maps) is no alpha. Throws as decode_ktx2()
/// does.
GrayImage decode_ktx2_alpha(std::span<const std::byte> bytes, const std::string& name, std::int64_t max_pixels);

/// Decodes a KTX2 texture or any format of imaging::decode_rgb.
RgbImage decode_texture(std::span<const std::byte> bytes, const std::string& name, std::int64_t max_pixels);

}  // namespace tileflight::imaging
