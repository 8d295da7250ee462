#include "tileflight/imaging/image.h"

#include <algorithm>

namespace tileflight::imaging {

GrayImage to_gray(const RgbImage& image) {
  GrayImage gray(image.width, image.height);
  const auto luma = [](const Rgb8& p) {
    return static_cast<std::uint8_t>((299U * p[0] + 587U * p[1] + 114U * p[2] + 500U) / 1000U);
  };
  std::transform(image.pixels.begin(), image.pixels.end(), gray.pixels.begin(), luma);
  return gray;
}

RgbImage to_rgb(const GrayImage& image) {
  RgbImage rgb(image.width, image.height);
  std::transform(image.pixels.begin(), image.pixels.end(), rgb.pixels.begin(), [](std::uint8_t value) {
    return Rgb8{value, value, value};
  });
  return rgb;
}

}  // namespace tileflight::imaging
