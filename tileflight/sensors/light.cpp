#include "tileflight/sensors/light.h"

#include <algorithm>
#include <cmath>

namespace tileflight::sensors {

double srgb_encode(double linear) {
  const double clamped = std::clamp(linear, 0.0, 1.0);
  const double value = clamped <= 0.0031308 ? 12.92 * clamped : 1.055 * std::pow(clamped, 1.0 / 2.4) - 0.055;
  return 255.0 * value;
}

double srgb_decode(double encoded) {
  const double value = std::clamp(encoded / 255.0, 0.0, 1.0);
  return value <= 0.04045 ? value / 12.92 : std::pow((value + 0.055) / 1.055, 2.4);
}

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

float SrgbTables::decode(float encoded) const {
  const float clamped = std::clamp(encoded, 0.0F, 255.0F);
  const int below = static_cast<int>(clamped);
  return linear_[below] + (clamped - static_cast<float>(below)) * (linear_[below + 1] - linear_[below]);
}

float SrgbTables::encode(float linear) const {
  const float position = std::sqrt(std::clamp(linear, 0.0F, 1.0F)) * static_cast<float>(kSteps);
  const int below = static_cast<int>(position);
  return encoded_[below] + (position - static_cast<float>(below)) * (encoded_[below + 1] - encoded_[below]);
}

imaging::Rgb8 SrgbTables::encode(const Light& light) const {
  imaging::Rgb8 pixel;
  for (int i = 0; i < 3; ++i) pixel[i] = static_cast<std::uint8_t>(encode(light[i]) + 0.5F);
  return pixel;
}

}  // namespace tileflight::sensors
