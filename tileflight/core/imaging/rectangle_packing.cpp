#include "tileflight/core/imaging/rectangle_packing.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <numeric>

namespace tileflight::imaging {
namespace {

int atlas_width(const std::vector<PixelSize>& rectangles) {
  std::int64_t area = 0;
  int widest = 1;
  for (const PixelSize& r : rectangles) {
    area += static_cast<std::int64_t>(r.width) * r.height;
    widest = std::max(widest, r.width);
  }
  return std::max(widest, static_cast<int>(std::ceil(std::sqrt(1.08 * static_cast<double>(area)))));
}

std::vector<std::size_t> tallest_first(const std::vector<PixelSize>& rectangles) {
  std::vector<std::size_t> order(rectangles.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::stable_sort(order.begin(), order.end(),
                   [&](std::size_t a, std::size_t b) { return rectangles[a].height > rectangles[b].height; });
  return order;
}

}  // namespace

RectanglePacking pack_rectangles(const std::vector<PixelSize>& rectangles) {
  RectanglePacking packing;
  packing.positions.resize(rectangles.size());
  packing.size.width = atlas_width(rectangles);
  int x = 0, shelf_y = 0, shelf_height = 0;
  for (const std::size_t i : tallest_first(rectangles)) {
    const PixelSize& r = rectangles[i];
    if (x + r.width > packing.size.width) {
      shelf_y += shelf_height;
      x = shelf_height = 0;
    }
    packing.positions[i] = {x, shelf_y};
    x += r.width;
    shelf_height = std::max(shelf_height, r.height);
  }
  packing.size.height = shelf_y + shelf_height;
  return packing;
}

}  // namespace tileflight::imaging
