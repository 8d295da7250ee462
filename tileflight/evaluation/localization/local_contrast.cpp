#include "tileflight/evaluation/localization/local_contrast.h"

#include <algorithm>
#include <cmath>

#include "tileflight/core/imaging/summed_area_table.h"

namespace tileflight::localization {

imaging::FloatImage normalize_local_contrast(const imaging::FloatImage& image, int reach, float least_deviation) {
  constexpr double kMean = 128.0, kDeviation = 40.0;
  const auto value = [&](int x, int y) { return static_cast<double>(image(x, y)); };
  const imaging::SummedAreaTable<double> sums(image.width, image.height, value);
  const imaging::SummedAreaTable<double> squares(image.width, image.height,
                                                 [&](int x, int y) { return value(x, y) * value(x, y); });
  imaging::FloatImage result(image.width, image.height);
  for (int y = 0; y < image.height; ++y) {
    const int y0 = std::max(0, y - reach), y1 = std::min(image.height, y + reach + 1);
    for (int x = 0; x < image.width; ++x) {
      const int x0 = std::max(0, x - reach), x1 = std::min(image.width, x + reach + 1);
      const double n = static_cast<double>(x1 - x0) * (y1 - y0);
      const double mean = sums.sum(x0, y0, x1, y1) / n;
      const double variance = std::max(0.0, squares.sum(x0, y0, x1, y1) / n - mean * mean);
      result(x, y) =
          static_cast<float>(kMean + kDeviation * (image(x, y) - mean) / (std::sqrt(variance) + least_deviation));
    }
  }
  return result;
}

}  // namespace tileflight::localization
