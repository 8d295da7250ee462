#include "tileflight/core/imaging/image.h"

#include <gtest/gtest.h>

#include <cmath>

namespace tileflight::imaging::image_test {
namespace {

TEST(Image, RowsFromTheTop) {
  GrayImage image(3, 2, 7);
  image(2, 1) = 9;
  EXPECT_EQ(image.pixels, (std::vector<std::uint8_t>{7, 7, 7, 7, 7, 9}));
  EXPECT_EQ(image.row(1)[2], 9);
  EXPECT_TRUE(GrayImage().empty());
}

TEST(Image, LumaIsRec601Rounded) {
  RgbImage image(256, 256);
  for (int y = 0; y < 256; ++y)
    for (int x = 0; x < 256; ++x)
      image(x, y) = {static_cast<std::uint8_t>(x), static_cast<std::uint8_t>(y),
                     static_cast<std::uint8_t>((3 * x + 5 * y) % 256)};
  const GrayImage gray = to_gray(image);
  for (std::size_t i = 0; i < image.pixels.size(); ++i) {
    const auto [r, g, b] = image.pixels[i];
    EXPECT_NEAR(gray.pixels[i], 0.299 * r + 0.587 * g + 0.114 * b, 0.5 + 1e-9);
  }
  EXPECT_EQ(to_gray(RgbImage(1, 1, {255, 255, 255})).pixels[0], 255);
}

TEST(Image, GrayComesBackFromRgb) {
  GrayImage gray(256, 1);
  for (int x = 0; x < 256; ++x) gray(x, 0) = static_cast<std::uint8_t>(x);
  EXPECT_EQ(to_gray(to_rgb(gray)).pixels, gray.pixels);
}

TEST(Shrink, APixelIsTheMeanOfWhatItCovers) {
  FloatImage image(6, 4);
  for (int y = 0; y < 4; ++y)
    for (int x = 0; x < 6; ++x) image(x, y) = static_cast<float>(10 * y + x);
  const FloatImage half = downsample(image, 3, 2);
  EXPECT_FLOAT_EQ(half(0, 0), (0 + 1 + 10 + 11) / 4.0F);
  EXPECT_FLOAT_EQ(half(2, 1), (24 + 25 + 34 + 35) / 4.0F);
  // A ramp stays a ramp over the pixels' centres, also where sizes do not divide.
  const FloatImage odd = downsample(image, 4, 3);
  for (int x = 0; x < 4; ++x) {
    const double covers = 1.5 * x;  // 1.5 pixels from here; value is the pixel's index
    const int first = static_cast<int>(covers);
    const double of_first = std::min(1.5, first + 1 - covers);
    EXPECT_NEAR(odd(x, 0) - odd(0, 0), (of_first * first + (1.5 - of_first) * (first + 1)) / 1.5 - (0.5 * 1) / 1.5,
                1e-5);
  }
  double sum = 0, small_sum = 0;
  for (const float v : image.pixels) sum += v;
  for (const float v : odd.pixels) small_sum += v;
  EXPECT_NEAR(small_sum / 12, sum / 24, 1e-4);
  EXPECT_EQ(downsample(image, 6, 4).pixels, image.pixels);
}

}  // namespace
}  // namespace tileflight::imaging::image_test
