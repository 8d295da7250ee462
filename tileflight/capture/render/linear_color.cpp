#include "tileflight/capture/render/linear_color.h"

#include <algorithm>

#include "tileflight/core/base/srgb.h"

namespace tileflight::render {

double srgb_encode(double linear) { return 255.0 * base::srgb_from_linear(std::clamp(linear, 0.0, 1.0)); }

double srgb_decode(double encoded) { return base::linear_from_srgb(std::clamp(encoded / 255.0, 0.0, 1.0)); }

const SrgbTables& SrgbTables::get() {
  static const SrgbTables tables;
  return tables;
}

SrgbTables::SrgbTables() {
  for (int i = 0; i <= 256; ++i) linear_[i] = static_cast<float>(srgb_decode(std::min(i, 255)));
  for (int i = 0; i <= kSteps + 1; ++i) {
    const double root = static_cast<double>(i) / kSteps;
    encoded_[i] = static_cast<float>(srgb_encode(root * root));
  }
}

imaging::Rgb8 SrgbTables::encode(const LinearRgb& light) const {
  imaging::Rgb8 pixel;
  for (int i = 0; i < 3; ++i) pixel[i] = static_cast<std::uint8_t>(encode(light[i]) + 0.5F);
  return pixel;
}

PositiveCurve::PositiveCurve(const std::function<double(double)>& function, int most)
    : first_(index_of(std::ldexp(1.0F, most - kOctaves))) {
  for (std::uint32_t i = 0; i <= kOctaves * kPieces + 1; ++i)
    values_[i] = static_cast<float>(function(number_of(first_ + i)));
  most_ = std::ldexp(1.0F, most);
  least_ = std::ldexp(1.0F, most - kOctaves);
}

}  // namespace tileflight::render
