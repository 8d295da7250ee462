#include "tileflight/tiling/srgb.h"

#include <cmath>

namespace tileflight::tiling {

float linear_from_srgb(float encoded) {
  return encoded <= 0.04045F ? encoded / 12.92F : std::pow((encoded + 0.055F) / 1.055F, 2.4F);
}

float srgb_from_linear(float linear) {
  return linear <= 0.0031308F ? 12.92F * linear : 1.055F * std::pow(linear, 1.0F / 2.4F) - 0.055F;
}

std::array<std::uint8_t, 4> linear_bytes(const std::array<float, 3>& displayed) {
  std::array<std::uint8_t, 4> out{0, 0, 0, 255};
  for (std::size_t c = 0; c < 3; ++c)
    out[c] = static_cast<std::uint8_t>(std::lround(255.0F * linear_from_srgb(displayed[c])));
  return out;
}

}  // namespace tileflight::tiling
