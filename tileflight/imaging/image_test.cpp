#include "tileflight/imaging/image.h"

#include <gtest/gtest.h>

#include <cmath>

namespace tileflight::imaging {
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

}  // namespace
}  // namespace tileflight::imaging
