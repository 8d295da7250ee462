#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>

#include "tests/refusal.h"
#include "tileflight/core/imaging/image.h"

namespace tileflight::tests {

/// A smooth pattern that moves with `frame`, so that a decoded image identifies its frame.
inline imaging::RgbImage moving_picture(int width, int height, int frame) {
  imaging::RgbImage image(width, height);
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x) {
      const double wave = std::sin(0.11 * (x + 3.0 * frame)) * std::cos(0.07 * y);
      const auto level = static_cast<std::uint8_t>(128 + 90 * wave);
      image(x, y) = {level, static_cast<std::uint8_t>(255 - level), static_cast<std::uint8_t>(60 + 4 * (frame % 40))};
    }
  return image;
}

/// Peak signal-to-noise ratio over all channels, dB.
inline double psnr(const imaging::RgbImage& a, const imaging::RgbImage& b) {
  if (a.width != b.width || a.height != b.height) return 0.0;
  double sum = 0.0;
  for (std::size_t i = 0; i < a.pixels.size(); ++i)
    for (int c = 0; c < 3; ++c) sum += std::pow(a.pixels[i][c] - b.pixels[i][c], 2);
  return 10.0 * std::log10(255.0 * 255.0 * 3.0 * static_cast<double>(a.pixels.size()) / std::max(sum, 1e-9));
}

}  // namespace tileflight::tests
