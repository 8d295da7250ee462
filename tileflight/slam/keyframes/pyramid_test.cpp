#include "tileflight/slam/keyframes/pyramid.h"

#include <gtest/gtest.h>

namespace tileflight::keyframes::pyramid_test {
namespace {

imaging::RgbImage picture(int width, int height, int seed) {
  imaging::RgbImage image(width, height);
  for (std::size_t i = 0; i < image.pixels.size(); ++i) {
    const std::size_t value = (i * 2654435761U + static_cast<std::size_t>(seed)) >> 7U;
    image.pixels[i] = {static_cast<std::uint8_t>(value), static_cast<std::uint8_t>(value >> 8U),
                       static_cast<std::uint8_t>(value >> 16U)};
  }
  return image;
}

TEST(Pyramid, IsOfLumaAndOfMeansOfFour) {
  const imaging::RgbImage image = picture(53, 38, 1);  // not a multiple of the SIMD width
  const Pyramid pyramid = build_pyramid(luminance(image, nullptr), 3);
  for (int y = 0; y < 38; ++y) {
    for (int x = 0; x < 53; ++x) {
      const imaging::Rgb8 c = image(x, y);
      EXPECT_NEAR(pyramid.levels[0].intensity(x, y), 0.299 * c[0] + 0.587 * c[1] + 0.114 * c[2], 1e-4);
    }
  }
  for (int l = 1; l < 3; ++l) {
    const PyramidLevel &fine = pyramid.levels[l - 1], &half = pyramid.levels[l];
    ASSERT_EQ(half.width, fine.width / 2);
    for (int y = 0; y < half.height; ++y) {
      for (int x = 0; x < half.width; ++x) {
        const float sum = fine.intensity(2 * x, 2 * y) + fine.intensity(2 * x + 1, 2 * y) +
                          fine.intensity(2 * x, 2 * y + 1) + fine.intensity(2 * x + 1, 2 * y + 1);
        EXPECT_NEAR(half.intensity(x, y), sum / 4, 1e-4);
      }
    }
  }
}

TEST(PyramidPool, MakesWhatIsMadeAnewInTheMemoryOfWhatNobodyHolds) {
  PyramidPool pool;
  auto first = pool.make(picture(64, 48, 1), nullptr, 3);
  const auto held = pool.make(picture(64, 48, 2), nullptr, 3);
  const Pyramid before = *held;
  const float* memory = first->levels[0].row(0);
  const float* memory_of_half = first->levels[1].row(0);
  first.reset();
  const imaging::RgbImage image = picture(64, 48, 3);
  const auto third = pool.make(image, nullptr, 3);
  EXPECT_EQ(third->levels[0].row(0), memory);
  EXPECT_EQ(third->levels[1].row(0), memory_of_half);
  const Pyramid anew = build_pyramid(luminance(image, nullptr), 3);
  for (std::size_t l = 0; l < 3; ++l) {
    EXPECT_TRUE(third->levels[l].grey == anew.levels[l].grey);
    EXPECT_TRUE(held->levels[l].grey == before.levels[l].grey);
  }
}

TEST(PyramidPool, MayGoBeforeWhatItMade) {
  auto pool = std::make_unique<PyramidPool>();
  auto pyramid = pool->make(picture(64, 48, 1), nullptr, 3);
  pool.reset();
  EXPECT_EQ(pyramid->levels.size(), 3U);
  pyramid.reset();
}

}  // namespace
}  // namespace tileflight::keyframes::pyramid_test
