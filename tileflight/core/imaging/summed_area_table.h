#pragma once

#include <cstddef>
#include <vector>

namespace tileflight::imaging {

/// Sums of a function of pixels over any rectangle in constant time (Crow, "Summed-area tables for texture mapping",
/// SIGGRAPH 1984).
template <class Value>
class SummedAreaTable {
 public:
  /// Sums `value(x, y)` over the pixels of an image of that size.
  template <class Function>
  SummedAreaTable(int width, int height, const Function& value)
      : columns_(static_cast<std::size_t>(width) + 1), sums_(columns_ * (static_cast<std::size_t>(height) + 1)) {
    for (int y = 0; y < height; ++y) {
      Value row{};
      for (int x = 0; x < width; ++x) {
        row += value(x, y);
        sums_[index(x + 1, y + 1)] = sums_[index(x + 1, y)] + row;
      }
    }
  }

  /// Returns the sum over x0 <= x < x1, y0 <= y < y1.
  Value sum(int x0, int y0, int x1, int y1) const {
    return sums_[index(x1, y1)] - sums_[index(x0, y1)] - sums_[index(x1, y0)] + sums_[index(x0, y0)];
  }

 private:
  std::size_t index(int x, int y) const { return static_cast<std::size_t>(y) * columns_ + static_cast<std::size_t>(x); }

  std::size_t columns_;
  std::vector<Value> sums_;  ///< over all pixels above and left of each corner of pixels
};

}  // namespace tileflight::imaging
