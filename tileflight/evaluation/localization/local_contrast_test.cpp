#include "tileflight/evaluation/localization/local_contrast.h"

#include <gtest/gtest.h>

#include <cmath>

namespace tileflight::localization::local_contrast_test {
namespace {

imaging::FloatImage pattern(double gain, double offset, double slope) {
  imaging::FloatImage image(64, 48);
  for (int y = 0; y < 48; ++y)
    for (int x = 0; x < 64; ++x)
      image(x, y) =
          static_cast<float>(gain * 30.0 * std::sin(0.9 * x + 0.4 * y) * std::cos(1.1 * y) + offset + slope * x);
  return image;
}

TEST(LocalContrast, IsTheDefinitionByBruteForce) {
  const imaging::FloatImage image = pattern(1.0, 100.0, 0.5);
  const imaging::FloatImage even = normalize_local_contrast(image, 5, 4.0F);
  for (const auto& [x, y] : {std::pair{0, 0}, {63, 47}, {20, 30}, {3, 25}}) {
    double sum = 0.0, squares = 0.0, n = 0.0;
    for (int v = std::max(0, y - 5); v <= std::min(47, y + 5); ++v) {
      for (int u = std::max(0, x - 5); u <= std::min(63, x + 5); ++u) {
        sum += image(u, v);
        squares += image(u, v) * image(u, v);
        n += 1.0;
      }
    }
    const double mean = sum / n, deviation = std::sqrt(squares / n - mean * mean);
    EXPECT_NEAR(even(x, y), 128.0 + 40.0 * (image(x, y) - mean) / (deviation + 4.0), 1e-2);
  }
}

TEST(LocalContrast, LightThatChangesSlowlyFallsAway) {
  const imaging::FloatImage a = normalize_local_contrast(pattern(1.0, 100.0, 0.0), 8, 0.5F);
  const imaging::FloatImage b = normalize_local_contrast(pattern(1.6, 40.0, 0.6), 8, 0.5F);
  double squares = 0.0;
  for (std::size_t i = 0; i < a.pixels.size(); ++i) squares += std::pow(a.pixels[i] - b.pixels[i], 2);
  EXPECT_LT(std::sqrt(squares / static_cast<double>(a.pixels.size())), 8.0);  // of a deviation of 40
}

TEST(LocalContrast, AnEvenPictureStaysEven) {
  const imaging::FloatImage even = normalize_local_contrast(imaging::FloatImage(20, 10, 77.0F), 3);
  ASSERT_EQ(even.pixels.size(), 200U);
  for (const float value : even.pixels) EXPECT_NEAR(value, 128.0F, 1e-3F);
}

}  // namespace
}  // namespace tileflight::localization::local_contrast_test
