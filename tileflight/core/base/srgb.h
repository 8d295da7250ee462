#pragma once

#include <array>
#include <cmath>
#include <cstdint>

namespace tileflight::base {

/// Converts a displayed intensity (sRGB, 0..1) to linear light, and back (IEC 61966-2-1).
template <class Real>
Real linear_from_srgb(Real encoded) {
  if (encoded <= static_cast<Real>(0.04045)) return encoded / static_cast<Real>(12.92);
  return std::pow((encoded + static_cast<Real>(0.055)) / static_cast<Real>(1.055), static_cast<Real>(2.4));
}
template <class Real>
Real srgb_from_linear(Real linear) {
  if (linear <= static_cast<Real>(0.0031308)) return static_cast<Real>(12.92) * linear;
  return static_cast<Real>(1.055) * std::pow(linear, Real{1} / static_cast<Real>(2.4)) - static_cast<Real>(0.055);
}

/// Converts an sRGB colour (0..1) to a glTF vertex colour: linear, 8 bits a channel, opaque.
inline std::array<std::uint8_t, 4> linear_rgba_from_srgb(const std::array<float, 3>& displayed) {
  std::array<std::uint8_t, 4> out{0, 0, 0, 255};
  for (std::size_t c = 0; c < 3; ++c)
    out[c] = static_cast<std::uint8_t>(std::lround(255.0F * linear_from_srgb(displayed[c])));
  return out;
}

}  // namespace tileflight::base
