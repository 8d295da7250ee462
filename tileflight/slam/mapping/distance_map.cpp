#include "tileflight/slam/mapping/distance_map.h"

#include <algorithm>
#include <cassert>
#include <cstdlib>

namespace tileflight::mapping {

DistanceMap::DistanceMap(int width, int height, int limit)
    : width_(width), height_(height), limit_(limit), distance_(static_cast<std::size_t>(width) * height) {
  assert(limit > 0 && limit < 256);
  std::fill(distance_.begin(), distance_.end(), static_cast<std::uint8_t>(limit));
}

void DistanceMap::add(int x, int y) {
  if (!contains(x, y)) return;
  for (int dy = -(limit_ - 1); dy < limit_; ++dy) {
    const int yy = y + dy;
    if (yy < 0 || yy >= height_) continue;
    const int reach = limit_ - 1 - std::abs(dy);
    for (int xx = std::max(0, x - reach); xx <= std::min(width_ - 1, x + reach); ++xx) {
      std::uint8_t& d = distance_[index(xx, yy)];
      d = std::min(d, static_cast<std::uint8_t>(std::abs(dy) + std::abs(xx - x)));
    }
  }
}

}  // namespace tileflight::mapping
