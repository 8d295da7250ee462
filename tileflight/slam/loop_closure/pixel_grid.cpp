#include "tileflight/slam/loop_closure/pixel_grid.h"

#include <cmath>

namespace tileflight::loop_closure {

std::vector<float> PixelGrid::rho_within(const Eigen::Vector2f& pixel, float radius_px) const {
  std::vector<float> out;
  for (int dy = -1; dy <= 1; ++dy) {
    for (int dx = -1; dx <= 1; ++dx) {
      const auto cell = cells_.find(key(pixel + kCell_px * Eigen::Vector2f(dx, dy)));
      if (cell == cells_.end()) continue;
      for (const KnownPixel& known : cell->second) {
        if ((known.pixel - pixel).norm() < radius_px) out.push_back(known.rho);
      }
    }
  }
  return out;
}

std::pair<int, int> PixelGrid::key(const Eigen::Vector2f& pixel) {
  return {static_cast<int>(std::floor(pixel.x() / kCell_px)), static_cast<int>(std::floor(pixel.y() / kCell_px))};
}

}  // namespace tileflight::loop_closure
