#include "tileflight/core/imaging/summed_area_table.h"

#include <gtest/gtest.h>

#include <cstdint>
#include <random>

namespace tileflight::imaging::summed_area_table_test {
namespace {

TEST(SummedAreaTable, EveryRectangleHasTheSumOfItsPixels) {
  constexpr int kWidth = 7, kHeight = 5;
  std::mt19937 random(4);
  std::vector<int> pixels(kWidth * kHeight);
  for (int& pixel : pixels) pixel = static_cast<int>(random() % 100) - 50;
  const auto value = [&](int x, int y) { return pixels[static_cast<std::size_t>(y * kWidth + x)]; };
  const SummedAreaTable<std::int64_t> table(kWidth, kHeight, value);
  int rectangles = 0;
  for (int y0 = 0; y0 <= kHeight; ++y0)
    for (int x0 = 0; x0 <= kWidth; ++x0)
      for (int y1 = y0; y1 <= kHeight; ++y1)
        for (int x1 = x0; x1 <= kWidth; ++x1) {
          std::int64_t sum = 0;
          for (int y = y0; y < y1; ++y)
            for (int x = x0; x < x1; ++x) sum += value(x, y);
          EXPECT_EQ(table.sum(x0, y0, x1, y1), sum);
          ++rectangles;
        }
  EXPECT_EQ(rectangles, 36 * 21);
}

}  // namespace
}  // namespace tileflight::imaging::summed_area_table_test
