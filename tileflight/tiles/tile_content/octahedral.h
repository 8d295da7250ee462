#pragma once

#include <Eigen/Core>
#include <cmath>

namespace tileflight::tile_content {

/// Decodes a unit vector from its octahedral encoding, two numbers in 0..`range` (Cigolle et al., "A Survey of
/// Efficient Representations for Independent Unit Vectors", 2014).
inline Eigen::Vector3d decode_octahedral(double u, double v, double range) {
  const double x = 2 * u / range - 1;
  const double y = 2 * v / range - 1;
  Eigen::Vector3d out(x, y, 1 - std::abs(x) - std::abs(y));
  if (out.z() < 0) {
    out.x() = (1 - std::abs(y)) * (x < 0 ? -1 : 1);
    out.y() = (1 - std::abs(x)) * (y < 0 ? -1 : 1);
  }
  return out.normalized();
}

}  // namespace tileflight::tile_content
