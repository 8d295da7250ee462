#include "tileflight/localization/local_contrast.h"

#include <algorithm>
#include <cmath>
#include <vector>

namespace tileflight::localization {

namespace {

/// Sums over all pixels above and left of a corner: (width + 1) x (height + 1).
class SummedAreaTable {
 public:
  SummedAreaTable(const imaging::FloatImage& image, bool squared)
      : width_(static_cast<std::size_t>(image.width) + 1),
        sums_(width_ * (static_cast<std::size_t>(image.height) + 1)) {
    for (int y = 0; y < image.height; ++y) {
      double row = 0.0;
      for (int x = 0; x < image.width; ++x) {
        const double value = image(x, y);
        row += squared ? value * value : value;
        at(x + 1, y + 1) = at(x + 1, y) + row;
      }
    }
  }
  double operator()(int x0, int y0, int x1, int y1) const { return at(x1, y1) - at(x0, y1) - at(x1, y0) + at(x0, y0); }

 private:
  double& at(int x, int y) { return sums_[static_cast<std::size_t>(y) * width_ + static_cast<std::size_t>(x)]; }
  double at(int x, int y) const { return sums_[static_cast<std::size_t>(y) * width_ + static_cast<std::size_t>(x)]; }

  std::size_t width_;
  std::vector<double> sums_;
};

}  // namespace

imaging::FloatImage normalize_local_contrast(const imaging::FloatImage& image, int reach, float least_deviation) {
  constexpr double kMean = 128.0, kDeviation = 40.0;
  const SummedAreaTable sums(image, false), squares(image, true);
  imaging::FloatImage result(image.width, image.height);
  for (int y = 0; y < image.height; ++y) {
    const int y0 = std::max(0, y - reach), y1 = std::min(image.height, y + reach + 1);
    for (int x = 0; x < image.width; ++x) {
      const int x0 = std::max(0, x - reach), x1 = std::min(image.width, x + reach + 1);
      const double n = static_cast<double>(x1 - x0) * (y1 - y0);
      const double mean = sums(x0, y0, x1, y1) / n;
      const double variance = std::max(0.0, squares(x0, y0, x1, y1) / n - mean * mean);
      result(x, y) =
          static_cast<float>(kMean + kDeviation * (image(x, y) - mean) / (std::sqrt(variance) + least_deviation));
    }
  }
  return result;
}

}  // namespace tileflight::localization
