#include "tileflight/alignment/spatial_order.h"

#include <Eigen/Geometry>
#include <algorithm>

namespace tileflight::alignment {

using geometry::Vec3;

namespace {

constexpr int kBits = 16;

/// Puts two zero bits after each of the lowest 16.
std::uint64_t spread_bits(std::uint64_t v) {
  v = (v | (v << 32)) & 0x00ff00000000ffffull;
  v = (v | (v << 16)) & 0x00ff0000ff0000ffull;
  v = (v | (v << 8)) & 0xf00f00f00f00f00full;
  v = (v | (v << 4)) & 0x30c30c30c30c30c3ull;
  return (v | (v << 2)) & 0x9249249249249249ull;
}

}  // namespace

std::vector<std::uint32_t> spatial_order(const std::vector<Vec3>& points) {
  Eigen::AlignedBox3d box;
  for (const Vec3& p : points) box.extend(p);
  const double edge = std::max(points.empty() ? 0.0 : box.sizes().maxCoeff(), 1e-300);
  const double cells = ((1 << kBits) - 1) / edge;
  std::vector<std::pair<std::uint64_t, std::uint32_t>> keyed(points.size());
  for (std::size_t i = 0; i < points.size(); ++i) {
    const Vec3 at = (points[i] - box.min()) * cells;
    std::uint64_t key = 0;
    for (int axis = 0; axis < 3; ++axis) key |= spread_bits(static_cast<std::uint64_t>(at[axis])) << axis;
    keyed[i] = {key, static_cast<std::uint32_t>(i)};
  }
  std::sort(keyed.begin(), keyed.end());
  std::vector<std::uint32_t> order(points.size());
  for (std::size_t i = 0; i < keyed.size(); ++i) order[i] = keyed[i].second;
  return order;
}

}  // namespace tileflight::alignment
