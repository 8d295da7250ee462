#include "tileflight/evaluation/metrics/part_search.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <limits>
#include <optional>
#include <span>

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

namespace {

using geometry::Box3;
using geometry::Vec3;

constexpr double kFar = std::numeric_limits<double>::infinity();
/// Widens a bound by more than rounding errors.
constexpr double kWider = 1.0 + 1e-9;

/// Neighbouring points, which mostly ask the same parts.
struct PointGroup {
  std::span<const std::uint32_t> points;
  Box3 box;
  std::size_t home = 0;  ///< the part next to it
};

/// The part nearest to the middle of a group; of several that contain it, the one with the nearest centre.
std::size_t home_of(const Box3& group, const std::vector<Box3>& bounds) {
  std::size_t home = 0;
  double least = kFar, least_to_center = kFar;
  const Vec3 middle = group.center();
  for (std::size_t part = 0; part < bounds.size(); ++part) {
    if (bounds[part].isEmpty()) continue;
    const double distance2 = bounds[part].squaredExteriorDistance(middle);
    const double to_center2 = (bounds[part].center() - middle).squaredNorm();
    if (distance2 > least || (distance2 == least && !(to_center2 < least_to_center))) continue;
    home = part;
    least = distance2;
    least_to_center = to_center2;
  }
  return home;
}

std::vector<PointGroup> groups_of(const std::vector<Vec3>& points, const std::vector<std::uint32_t>& order,
                                  const std::vector<Box3>& bounds) {
  constexpr std::size_t kTogether = 1024;
  std::vector<PointGroup> groups((order.size() + kTogether - 1) / kTogether);
  tbb::parallel_for(std::size_t{0}, groups.size(), [&](std::size_t g) {
    PointGroup& group = groups[g];
    group.points = std::span(order).subspan(g * kTogether).first(std::min(kTogether, order.size() - g * kTogether));
    for (const std::uint32_t i : group.points) group.box.extend(points[i]);
    group.home = home_of(group.box, bounds);
  });
  return groups;
}

/// The points of a group whose reach is not below their distance to a box.
void add_in_reach(const PointGroup& group, const Box3& box, const std::vector<Vec3>& points,
                  const std::vector<double>& reach_m, std::vector<std::uint32_t>& asked) {
  const double least2 = box.squaredExteriorDistance(group.box);
  for (const std::uint32_t i : group.points) {
    const double reach2 = kWider * reach_m[i] * reach_m[i];
    if (least2 <= reach2 && box.squaredExteriorDistance(points[i]) <= reach2) asked.push_back(i);
  }
}

}  // namespace

void search_parts(const std::vector<Vec3>& points, const std::vector<Box3>& bounds, std::vector<double>& reach_m,
                  const PartSearch& search) {
  const std::vector<std::uint32_t> order = geometry::morton_order(points);
  if (bounds.size() == 1) {
    if (!bounds.front().isEmpty()) search(0, order);
    return;
  }
  const std::vector<PointGroup> groups = groups_of(points, order, bounds);
  for (const bool at_home : {true, false}) {
    for (std::size_t part = 0; part < bounds.size(); ++part) {
      if (bounds[part].isEmpty()) continue;
      std::vector<std::uint32_t> asked;
      for (const PointGroup& group : groups) {
        if ((group.home == part) == at_home) add_in_reach(group, bounds[part], points, reach_m, asked);
      }
      if (!asked.empty()) search(part, asked);
    }
  }
}

void lower_reach(const std::vector<Vec3>& points, const std::vector<std::uint32_t>& asked, const NearestWithin& nearest,
                 std::vector<double>& reach_m) {
  tbb::parallel_for(tbb::blocked_range<std::size_t>(0, asked.size(), 512), [&](const auto& range) {
    double before_m = kFar;
    for (std::size_t k = range.begin(); k < range.end(); ++k) {
      const Vec3& p = points[asked[k]];
      const double way_m = k > range.begin() ? (p - points[asked[k - 1]]).norm() : 0.0;
      double& reach = reach_m[asked[k]];
      const std::optional<double> found = nearest(p, std::min(reach, kWider * (before_m + way_m)));
      before_m = found.value_or(kFar);
      if (found) reach = std::min(reach, *found);
    }
  });
}

}  // namespace tileflight::metrics
