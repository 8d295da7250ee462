#pragma once

#include <cstdint>
#include <vector>

namespace tileflight::odometry {

/// How far each pixel of a small picture is from the nearest added one, in pixels (city-block), up to a limit.
class DistanceMap {
 public:
  DistanceMap(int width, int height, int limit);

  /// Adds a point; distances around it shrink. Outside: ignored.
  void add(int x, int y);
  /// The limit where nothing is near, or outside.
  int at(int x, int y) const { return contains(x, y) ? distance_[index(x, y)] : limit_; }
  bool contains(int x, int y) const { return x >= 0 && y >= 0 && x < width_ && y < height_; }

 private:
  std::size_t index(int x, int y) const { return static_cast<std::size_t>(y) * width_ + x; }

  int width_, height_, limit_;
  std::vector<std::uint8_t> distance_;
};

}  // namespace tileflight::odometry
