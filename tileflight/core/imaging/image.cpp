#include "tileflight/core/imaging/image.h"

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

namespace {

/// Downsamples a row of `count` values, `step` apart, to `size` area means.
void downsample_row(const float* values, int count, std::size_t step, float* means, int size, std::size_t mean_step) {
  const double share = static_cast<double>(count) / size;
  for (int i = 0; i < size; ++i) {
    const double begin = i * share, end = begin + share;
    double sum = 0.0;
    for (int k = static_cast<int>(begin); k < count && k < end; ++k)
      sum += (std::min<double>(end, k + 1) - std::max<double>(begin, k)) * values[static_cast<std::size_t>(k) * step];
    means[static_cast<std::size_t>(i) * mean_step] = static_cast<float>(sum / share);
  }
}

}  // namespace

FloatImage downsample(const FloatImage& image, int width, int height) {
  assert(width > 0 && width <= image.width && height > 0 && height <= image.height);
  if (width == image.width && height == image.height) return image;
  FloatImage narrow(width, image.height), result(width, height);
  for (int y = 0; y < image.height; ++y) downsample_row(image.row(y), image.width, 1, narrow.row(y), width, 1);
  const auto stride = static_cast<std::size_t>(width);
  for (int x = 0; x < width; ++x)
    downsample_row(narrow.row(0) + x, image.height, stride, result.row(0) + x, height, stride);
  return result;
}

}  // namespace tileflight::imaging
