#include "tileflight/core/imaging/rectangle_packing.h"

#include <gtest/gtest.h>

#include <cstddef>

#include "tileflight/core/base/noise.h"

namespace tileflight::imaging::rectangle_packing_test {
namespace {

std::vector<PixelSize> random_rectangles(std::uint32_t seed, int count, int largest) {
  base::HashRandom random(seed);
  std::vector<PixelSize> sizes;
  for (int i = 0; i < count; ++i)
    sizes.push_back(
        {1 + static_cast<int>(random.uniform() * largest), 1 + static_cast<int>(random.uniform() * largest)});
  return sizes;
}

TEST(RectanglePacking, EveryPixelBelongsToAtMostOneRectangle) {
  const std::vector<PixelSize> sizes = random_rectangles(3, 120, 40);
  const RectanglePacking packing = pack_rectangles(sizes);
  std::vector<int> owners(static_cast<std::size_t>(packing.size.width) * packing.size.height, 0);
  for (std::size_t i = 0; i < sizes.size(); ++i) {
    ASSERT_GE(packing.positions[i].x, 0);
    ASSERT_LE(packing.positions[i].x + sizes[i].width, packing.size.width);
    ASSERT_LE(packing.positions[i].y + sizes[i].height, packing.size.height);
    for (int y = 0; y < sizes[i].height; ++y)
      for (int x = 0; x < sizes[i].width; ++x)
        ++owners[static_cast<std::size_t>(packing.positions[i].y + y) * packing.size.width + packing.positions[i].x +
                 x];
  }
  for (const int owner : owners) ASSERT_LE(owner, 1);
}

TEST(RectanglePacking, WastesLittle) {
  const std::vector<PixelSize> sizes = random_rectangles(4, 500, 60);
  const RectanglePacking packing = pack_rectangles(sizes);
  double used = 0;
  for (const PixelSize& size : sizes) used += static_cast<double>(size.width) * size.height;
  EXPECT_GT(used / (static_cast<double>(packing.size.width) * packing.size.height), 0.80);
}

TEST(RectanglePacking, OneRectangleFillsItsSheetWhenItIsWide) {
  const RectanglePacking packing = pack_rectangles({{40, 10}});
  EXPECT_EQ(packing.size.width, 40);
  EXPECT_EQ(packing.size.height, 10);
}

}  // namespace
}  // namespace tileflight::imaging::rectangle_packing_test
