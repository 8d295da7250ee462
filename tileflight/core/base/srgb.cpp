#include "tileflight/core/base/srgb.h"

#include <cmath>

namespace tileflight::base {

std::array<std::uint8_t, 4> linear_rgba_from_srgb(const std::array<float, 3>& displayed) {
  std::array<std::uint8_t, 4> out{0, 0, 0, 255};
  for (std::size_t c = 0; c < 3; ++c)
    out[c] = static_cast<std::uint8_t>(std::lround(255.0F * linear_from_srgb(displayed[c])));
  return out;
}

}  // namespace tileflight::base
