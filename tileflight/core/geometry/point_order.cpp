#include "tileflight/core/geometry/point_order.h"

#include <tbb/parallel_for.h>
#include <tbb/parallel_sort.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cstdint>
#include <functional>
#include <numeric>
#include <tuple>
#include <utility>
#include <vector>

namespace tileflight::geometry {

namespace {

struct KeyedPoint {
  std::uint64_t code;
  std::uint32_t index;
};

constexpr double kCell_m = 0.25;
/// 2^21 cells an axis, with the frame's origin in the middle.
constexpr double kHalfWidth_m = kCell_m * 1048576.0;

auto position_and_normal(const PointCloud& cloud, std::uint32_t i) {
  const Vec3& p = cloud.positions[i];
  const Eigen::Vector3f n = cloud.normals.empty() ? Eigen::Vector3f(0, 0, 0) : cloud.normals[i];
  return std::tuple(p.x(), p.y(), p.z(), n.x(), n.y(), n.z());
}

template <typename T>
std::vector<T> in_order(const std::vector<T>& values, const std::vector<KeyedPoint>& order) {
  std::vector<T> sorted(values.size());
  tbb::parallel_for(std::size_t{0}, sorted.size(), [&](std::size_t i) { sorted[i] = values[order[i].index]; });
  return sorted;
}

/// Three numbers below 2^21 fit into 64 bits; with so many cells an outlier does not squeeze the other points into few
/// cells.
constexpr double kLastCell = 2097151.0;

/// Moves the 21 low bits to every third bit.
std::uint64_t spread(std::uint64_t bits) {
  bits = (bits | bits << 32) & 0x001f00000000ffffull;
  bits = (bits | bits << 16) & 0x001f0000ff0000ffull;
  bits = (bits | bits << 8) & 0x100f00f00f00f00full;
  bits = (bits | bits << 4) & 0x10c30c30c30c30c3ull;
  return (bits | bits << 2) & 0x1249249249249249ull;
}

/// Cell and index of a point: sorted, the points are in Morton order.
using Key = std::pair<std::uint64_t, std::uint32_t>;

std::vector<Key> sorted_keys(const std::vector<Vec3>& points, double cells) {
  Eigen::AlignedBox3d box;
  for (const Vec3& p : points) box.extend(p);
  const double longest = points.empty() ? 0.0 : box.sizes().maxCoeff();
  const double cells_a_metre = longest > 0.0 ? cells / longest : 0.0;
  std::vector<Key> keys(points.size());
  tbb::parallel_for(std::size_t{0}, points.size(), [&](std::size_t i) {
    keys[i] = {morton_code(points[i], box.min(), cells_a_metre), static_cast<std::uint32_t>(i)};
  });
  tbb::parallel_sort(keys.begin(), keys.end());
  return keys;
}

std::vector<std::uint32_t> indices_of(const std::vector<Key>& keys) {
  std::vector<std::uint32_t> order(keys.size());
  std::ranges::transform(keys, order.begin(), [](const Key& key) { return key.second; });
  return order;
}

}  // namespace

void sort_by_position(PointCloud& cloud) {
  std::vector<KeyedPoint> order(cloud.size());
  tbb::parallel_for(std::size_t{0}, order.size(), [&](std::size_t i) {
    order[i] = {morton_code(cloud.positions[i], Vec3::Constant(-kHalfWidth_m), 1.0 / kCell_m),
                static_cast<std::uint32_t>(i)};
  });
  tbb::parallel_sort(order.begin(), order.end(), [&](const KeyedPoint& a, const KeyedPoint& b) {
    if (a.code != b.code) return a.code < b.code;
    return position_and_normal(cloud, a.index) < position_and_normal(cloud, b.index);
  });
  cloud.positions = in_order(cloud.positions, order);
  if (!cloud.normals.empty()) cloud.normals = in_order(cloud.normals, order);
}

std::uint64_t morton_code(const Vec3& p, const Vec3& low, double cells_a_metre) {
  std::uint64_t code = 0;
  for (int axis = 0; axis < 3; ++axis) {
    const double cell = std::clamp((p[axis] - low[axis]) * cells_a_metre, 0.0, kLastCell);
    code |= spread(static_cast<std::uint64_t>(cell)) << axis;
  }
  return code;
}

std::vector<std::uint32_t> morton_order(const std::vector<Vec3>& points, double cells) {
  return indices_of(sorted_keys(points, cells));
}

std::vector<std::uint32_t> morton_order_of_places(const std::vector<Vec3>& points) {
  std::vector<Key> keys = sorted_keys(points, kLastCell + 1.0);
  const auto coordinates = [&](const Key& key) {
    const Vec3& p = points[key.second];
    return std::tuple(p.x(), p.y(), p.z(), key.second);
  };
  for (auto first = keys.begin(); first != keys.end();) {
    const auto last = std::find_if(first, keys.end(), [&](const Key& key) { return key.first != first->first; });
    if (last - first > 1) std::ranges::sort(first, last, std::less<>(), coordinates);
    first = last;
  }
  return indices_of(keys);
}

std::vector<std::uint32_t> sample_evenly(const std::vector<Vec3>& points, std::size_t count) {
  std::vector<std::uint32_t> chosen(std::min(count, points.size()));
  if (chosen.size() == points.size()) {
    std::iota(chosen.begin(), chosen.end(), 0U);
    return chosen;
  }
  const std::vector<std::uint32_t> order = morton_order(points);
  const double step = static_cast<double>(points.size()) / static_cast<double>(chosen.size());
  for (std::size_t k = 0; k < chosen.size(); ++k)
    chosen[k] = order[static_cast<std::size_t>((static_cast<double>(k) + 0.5) * step)];
  return chosen;
}

}  // namespace tileflight::geometry
