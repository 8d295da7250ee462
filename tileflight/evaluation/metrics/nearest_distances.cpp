#include "tileflight/evaluation/metrics/nearest_distances.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <limits>

#include "tileflight/core/geometry/point_order.h"

namespace tileflight::metrics {

using geometry::Vec3;

namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
/// Widens a bound by more than rounding errors.
constexpr double kSlack = 1.0 + 1e-9;

}  // namespace

std::vector<double> nearest_distances(const std::vector<Vec3>& points, double radius_m, const NearestWithin& nearest) {
  const std::vector<std::uint32_t> order = geometry::morton_order(points);
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

}  // namespace tileflight::metrics
