#pragma once

// Inverse distances of points by the pixel that they project to.

#include <Eigen/Core>
#include <map>
#include <utility>
#include <vector>

namespace tileflight::loop_closure {

struct KnownPixel {
  Eigen::Vector2f pixel;
  float rho = 0.0F;
};

/// Points projected into a keyframe, in a grid of square cells.
class PixelGrid {
 public:
  static constexpr float kCell_px = 16.0F;

  void add(const KnownPixel& known) { cells_[key(known.pixel)].push_back(known); }
  /// Inverse distances of the points within `radius_px`, which is at most one cell.
  std::vector<float> rho_within(const Eigen::Vector2f& pixel, float radius_px) const;

 private:
  static std::pair<int, int> key(const Eigen::Vector2f& pixel);

  std::map<std::pair<int, int>, std::vector<KnownPixel>> cells_;
};

}  // namespace tileflight::loop_closure
