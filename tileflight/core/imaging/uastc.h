#pragma once

#include <cstddef>
#include <span>
#include <string>

#include "tileflight/core/imaging/image.h"

namespace tileflight::imaging {

/// Returns the size of a UASTC image in bytes: 16 for each block of 4 x 4 texels, row by row.
std::size_t uastc_bytes(int width, int height);

/// Decodes an image in UASTC LDR 4x4 ("UASTC LDR 4x4 Texture Specification", Basis Universal), a subset of ASTC with a
/// simpler block encoding. `srgb` selects how ASTC extends 8 bits to 16 before it interpolates (Khronos Data Format
/// Specification 1.3, section 23.19); the upper 8 bits of the result are kept. Alpha is left to decode_uastc_alpha().
/// Throws InputError (name, cause): too few bytes, an invalid block.
RgbImage decode_uastc(std::span<const std::byte> bytes, int width, int height, bool srgb, const std::string& name);

/// Decodes the alpha of the same image: 255 in blocks of the modes without alpha. Throws as decode_uastc() does.
GrayImage decode_uastc_alpha(std::span<const std::byte> bytes, int width, int height, const std::string& name);

}  // namespace tileflight::imaging
