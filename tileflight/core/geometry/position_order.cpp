#include "tileflight/core/geometry/position_order.h"

#include <tbb/parallel_for.h>
#include <tbb/parallel_sort.h>

#include <array>
#include <cstdint>
#include <tuple>
#include <vector>

#include "tileflight/core/geometry/point_order.h"

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

}  // namespace tileflight::geometry
