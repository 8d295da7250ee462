#include "tileflight/tiles/tile_writer/texture_filter.h"

#include <gtest/gtest.h>

#include "tileflight/core/base/noise.h"

namespace tileflight::tile_writer::texture_filter_test {
namespace {

imaging::RgbImage random_image(int width, int height, std::uint32_t seed) {
  base::HashRandom random(seed);
  imaging::RgbImage image(width, height);
  for (imaging::Rgb8& pixel : image.pixels)
    for (std::uint8_t& value : pixel) value = static_cast<std::uint8_t>(random.bits());
  return image;
}

TEST(Shrunk, HalvesAsTheMeanOfFour) {
  const imaging::RgbImage image = random_image(12, 8, 1);
  const imaging::RgbImage half = resize_area(image, 6, 4);
  for (int y = 0; y < 4; ++y)
    for (int x = 0; x < 6; ++x)
      for (std::size_t c = 0; c < 3; ++c) {
        const double mean = (image(2 * x, 2 * y)[c] + image(2 * x + 1, 2 * y)[c] + image(2 * x, 2 * y + 1)[c] +
                             image(2 * x + 1, 2 * y + 1)[c]) /
                            4.0;
        EXPECT_NEAR(half(x, y)[c], mean, 0.51);
      }
}

TEST(Shrunk, WeighsPartsOfPixels) {
  imaging::RgbImage image(3, 1);
  image(0, 0) = {30, 0, 255};
  image(1, 0) = {60, 0, 255};
  image(2, 0) = {90, 0, 255};
  const imaging::RgbImage out = resize_area(image, 2, 1);
  EXPECT_EQ(out(0, 0), (imaging::Rgb8{40, 0, 255}));  // (30 + 60/2) / 1.5
  EXPECT_EQ(out(1, 0), (imaging::Rgb8{80, 0, 255}));
}

TEST(Shrunk, SameSizeIsTheSameImage) {
  const imaging::RgbImage image = random_image(7, 5, 2);
  EXPECT_EQ(resize_area(image, 7, 5).pixels, image.pixels);
}

TEST(Blurred, KeepsAConstantAndSpreadsAPoint) {
  EXPECT_EQ(blur_binomial(imaging::RgbImage(4, 3, {9, 99, 199})).pixels, imaging::RgbImage(4, 3, {9, 99, 199}).pixels);
  imaging::RgbImage point(5, 5);
  point(2, 2) = {160, 160, 160};
  const imaging::RgbImage out = blur_binomial(point);
  EXPECT_EQ(out(2, 2)[0], 40);
  EXPECT_EQ(out(1, 2)[0], 20);
  EXPECT_EQ(out(1, 1)[0], 10);
  EXPECT_EQ(out(0, 2)[0], 0);
}

}  // namespace
}  // namespace tileflight::tile_writer::texture_filter_test
