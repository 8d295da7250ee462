#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <functional>

#include "tileflight/core/imaging/image.h"

namespace tileflight::render {

/// Linear red, green and blue; 1 is the white of a texture. May exceed 1 before exposure.
using LinearRgb = std::array<float, 3>;
using LinearImage = imaging::Image<LinearRgb>;

/// Convert linear light 0..1 to encoded values 0..255 by the sRGB transfer curve (IEC 61966-2-1), and back.
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

/// A function of positive numbers up to 2^most, tabulated over 24 octaves by 128 linear pieces each; the piece is found
/// from the bits of the number. Numbers outside the octaves have the value at their nearest end.
class PositiveCurve {
 public:
  /// `function`: is called with each piece's ends; `most`: exponent of the largest number.
  PositiveCurve(const std::function<double(double)>& function, int most);
  float at(float x) const {
    const float within = std::clamp(x, least_, most_);
    const auto bits = std::bit_cast<std::uint32_t>(within);
    const float* piece = &values_[(bits >> kShift) - first_];
    const float share = static_cast<float>(bits & ((1U << kShift) - 1U)) * (1.0F / static_cast<float>(1U << kShift));
    return piece[0] + share * (piece[1] - piece[0]);
  }

 private:
  static constexpr std::uint32_t kOctaves = 24, kPieces = 128, kShift = 23 - 7;
  static std::uint32_t index_of(float x) { return std::bit_cast<std::uint32_t>(x) >> kShift; }
  static double number_of(std::uint32_t index) { return std::bit_cast<float>(index << kShift); }

  std::uint32_t first_;
  float least_ = 0.0F, most_ = 0.0F;
  std::array<float, kOctaves * kPieces + 2> values_{};
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
