#pragma once

#include <array>
#include <cstdint>

#include "tileflight/imaging/image.h"

namespace tileflight::render {

/// Linear red, green and blue; 1 is the white of a texture. May exceed 1 before exposure.
using LinearRgb = std::array<float, 3>;
using LinearImage = imaging::Image<LinearRgb>;

/// sRGB transfer curve (IEC 61966-2-1): linear light 0..1 to encoded 0..255, and back.
double srgb_encode(double linear);
double srgb_decode(double encoded);

/// Table-based sRGB conversion for pixels. Values outside the range are clamped. Error below 0.002 grey levels.
class SrgbTables {
 public:
  /// Immutable, created at the first call.
  static const SrgbTables& get();

  float decode(std::uint8_t encoded) const { return linear_[encoded]; }
  float decode(float encoded) const;  ///< linear between grey levels
  float encode(float linear) const;   ///< 0..255, not rounded
  imaging::Rgb8 encode(const LinearRgb& light) const;

 private:
  static constexpr int kSteps = 4096;  // spaced evenly in the square root of light, where the curve is nearly straight
  SrgbTables();
  std::array<float, 257> linear_{};
  std::array<float, kSteps + 2> encoded_{};
};

}  // namespace tileflight::render
