#pragma once

#include <cstdint>
#include <vector>

namespace tileflight::mapping {

/// Distance of each pixel of a small image to the nearest added point, pixels (city-block), up to a limit.
class DistanceMap {
 public:
  DistanceMap(int width, int height, int limit);

  /// Adds a point and lowers the distances around it. Points outside are ignored.
  void add(int x, int y);
  /// Distance at a pixel; the limit where no point is near, and outside.
  int at(int x, int y) const { return contains(x, y) ? distance_[index(x, y)] : limit_; }
  bool contains(int x, int y) const { return x >= 0 && y >= 0 && x < width_ && y < height_; }

 private:
  std::size_t index(int x, int y) const { return static_cast<std::size_t>(y) * width_ + x; }

  int width_, height_, limit_;
  std::vector<std::uint8_t> distance_;
};

}  // namespace tileflight::mapping
