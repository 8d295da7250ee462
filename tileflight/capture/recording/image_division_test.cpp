#include "tileflight/capture/recording/image_division.h"

#include <gtest/gtest.h>

#include <vector>

#include "tileflight/capture/render/camera_renderer.h"

namespace tileflight::recording::image_division_test {
namespace {

using imaging::PixelRegion;

/// How many regions hold each pixel of an image.
std::vector<int> cover(int width, int height, const std::vector<PixelRegion>& regions) {
  std::vector<int> count(static_cast<std::size_t>(width) * static_cast<std::size_t>(height));
  for (const PixelRegion& region : regions) {
    for (int y = region.y0; y < region.y1; ++y) {
      for (int x = region.x0; x < region.x1; ++x) ++count[static_cast<std::size_t>(y * width + x)];
    }
  }
  return count;
}

TEST(ImageDivision, CoversTheImageOnceByRegionsWithinTheBudget) {
  for (const auto& [width, height] : {std::pair{1344, 756}, {320, 240}, {65, 33}, {1000, 20}, {30, 900}}) {
    // What the lower half shows costs thrice as much.
    const auto bytes_of = [&, h = height](const PixelRegion& region) {
      double bytes = 0.0;
      for (int y = region.y0; y < region.y1; ++y) bytes += region.width() * (y < h / 2 ? 1.0 : 3.0);
      return bytes;
    };
    const double budget = width * height / 9.0;
    const std::vector<PixelRegion> regions = divide_image(width, height, bytes_of, budget);
    EXPECT_EQ(cover(width, height, regions), std::vector<int>(static_cast<std::size_t>(width * height), 1));
    EXPECT_GE(regions.size(), 2U);
    for (const PixelRegion& region : regions) {
      EXPECT_TRUE(bytes_of(region) <= budget || !halves_of(region, bytes_of)) << region.x0 << " " << region.y0;
      EXPECT_EQ(region.x0 % render::kRegionStep, 0);
      EXPECT_EQ(region.y0 % render::kRegionStep, 0);
    }
  }
}

TEST(ImageDivision, DividesALargeImageInTwoEvenIfItFits) {
  EXPECT_EQ(divide_image(
                320, 240, [](const PixelRegion&) { return 0.0; }, 1.0)
                .size(),
            2U);
}

TEST(ImageDivision, TheSmallestRegionHasNoHalves) {
  const auto area = [](const PixelRegion& region) { return 1.0 * region.width() * region.height(); };
  EXPECT_FALSE(halves_of({64, 32, 72, 40}, area));
  EXPECT_FALSE(halves_of({128, 0, 129, 3}, area));
  const auto halves = halves_of({64, 32, 96, 48}, area);
  ASSERT_TRUE(halves);
  EXPECT_EQ(halves->first, (PixelRegion{64, 32, 80, 48}));
  EXPECT_EQ(halves->second, (PixelRegion{80, 32, 96, 48}));
}

TEST(ImageDivision, HalvesLieSideBySideWhereEachRowShowsTheSame) {
  const auto columns = [](const PixelRegion& region) { return 1.0 * region.width(); };
  const auto halves = halves_of({0, 0, 80, 320}, columns);
  ASSERT_TRUE(halves);
  EXPECT_EQ(halves->first, (PixelRegion{0, 0, 40, 320}));
}

}  // namespace
}  // namespace tileflight::recording::image_division_test
