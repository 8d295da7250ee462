#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
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

// In the inner loops of rendering.
inline float SrgbTables::decode(float encoded) const {
  const float clamped = std::clamp(encoded, 0.0F, 255.0F);
  const auto below = static_cast<std::size_t>(static_cast<int>(clamped));
  return linear_[below] + (clamped - static_cast<float>(below)) * (linear_[below + 1] - linear_[below]);
}

inline float SrgbTables::encode(float linear) const {
  const float position = std::sqrt(std::clamp(linear, 0.0F, 1.0F)) * static_cast<float>(kSteps);
  const auto below = static_cast<std::size_t>(static_cast<int>(position));
  return encoded_[below] + (position - static_cast<float>(below)) * (encoded_[below + 1] - encoded_[below]);
}

}  // namespace tileflight::render
