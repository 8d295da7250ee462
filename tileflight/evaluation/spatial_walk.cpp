#include "tileflight/evaluation/spatial_walk.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>
#include <tbb/parallel_sort.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

namespace tileflight::evaluation {

using geometry::Vec3;

namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
/// Widens a bound by more than its rounding.
constexpr double kSlack = 1.0 + 1e-9;

/// The 16 low bits moved to every third place.
std::uint64_t spread(std::uint64_t bits) {
  bits = (bits | bits << 32) & 0x00ff00000000ffffull;
  bits = (bits | bits << 16) & 0x00ff0000ff0000ffull;
  bits = (bits | bits << 8) & 0xf00f00f00f00f00full;
  bits = (bits | bits << 4) & 0x30c30c30c30c30c3ull;
  return (bits | bits << 2) & 0x9249249249249249ull;
}

std::uint64_t morton_code(const Vec3& p, const Vec3& low, double cells_a_metre) {
  std::uint64_t code = 0;
  for (int axis = 0; axis < 3; ++axis) {
    const double cell = std::clamp((p[axis] - low[axis]) * cells_a_metre, 0.0, 65535.0);
    code |= spread(static_cast<std::uint64_t>(cell)) << axis;
  }
  return code;
}

}  // namespace

std::vector<std::uint32_t> spatial_order(const std::vector<Vec3>& points) {
  Eigen::AlignedBox3d box;
  for (const Vec3& p : points) box.extend(p);
  const double longest = points.empty() ? 0.0 : box.sizes().maxCoeff();
  const double cells_a_metre = longest > 0.0 ? 65536.0 / longest : 0.0;
  std::vector<std::pair<std::uint64_t, std::uint32_t>> keys(points.size());
  tbb::parallel_for(std::size_t{0}, points.size(), [&](std::size_t i) {
    keys[i] = {morton_code(points[i], box.min(), cells_a_metre), static_cast<std::uint32_t>(i)};
  });
  tbb::parallel_sort(keys.begin(), keys.end());
  std::vector<std::uint32_t> order(points.size());
  std::ranges::transform(keys, order.begin(), [](const auto& key) { return key.second; });
  return order;
}

std::vector<double> distances_along_walk(const std::vector<Vec3>& points, double radius_m,
                                         const NearestWithin& nearest) {
  const std::vector<std::uint32_t> order = spatial_order(points);
  std::vector<double> distances(points.size());
  tbb::parallel_for(tbb::blocked_range<std::size_t>(0, order.size(), 512), [&](const auto& range) {
    double before_m = kInfinity;
    for (std::size_t k = range.begin(); k < range.end(); ++k) {
      const Vec3& p = points[order[k]];
      const double way_m = k > range.begin() ? (p - points[order[k - 1]]).norm() : 0.0;
      const double bound_m = std::min(radius_m, kSlack * (before_m + way_m));
      const std::optional<double> found = nearest(p, bound_m);
      before_m = found.value_or(kInfinity);
      distances[order[k]] = before_m;
    }
  });
  return distances;
}

}  // namespace tileflight::evaluation
