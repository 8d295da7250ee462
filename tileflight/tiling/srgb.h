#pragma once

#include <array>
#include <cstdint>

namespace tileflight::tiling {

/// Displayed intensity (sRGB, 0..1) to linear light and back (IEC 61966-2-1).
float linear_from_srgb(float encoded);
float srgb_from_linear(float linear);

/// A colour as displayed as a vertex colour of glTF: linear, opaque.
std::array<std::uint8_t, 4> linear_bytes(const std::array<float, 3>& displayed);

}  // namespace tileflight::tiling
