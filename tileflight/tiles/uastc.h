#pragma once

#include <cstddef>
#include <span>
#include <string>

#include "tileflight/imaging/image.h"

namespace tileflight::tiles {

/// Bytes of a UASTC picture: 16 for each block of four by four texels, row by row.
std::size_t uastc_bytes(int width, int height);

/// A picture in UASTC LDR 4x4 ("UASTC LDR 4x4 Texture Specification", Basis Universal), which is a part of ASTC in
/// simpler clothes. `srgb` picks how ASTC extends 8 bits to 16 before it interpolates (Khronos Data Format
/// Specification 1.3, section 23.19); the upper 8 bits of the result are kept. Alpha is dropped. Throws InputError
/// (name, cause): too few bytes, a block that no encoder may write.
imaging::RgbImage decode_uastc(std::span<const std::byte> bytes, int width, int height, bool srgb,
                               const std::string& name);

}  // namespace tileflight::tiles
