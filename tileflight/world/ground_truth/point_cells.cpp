#include "tileflight/world/ground_truth/point_cells.h"

#include <algorithm>
#include <cmath>
#include <optional>

namespace tileflight::ground_truth {
namespace {

using geometry::Cell;
using geometry::Vec3;
using geometry::VoxelGrid;

std::optional<Cell> cell_of(const Vec3& point, const VoxelGrid& grid) {
  const Vec3 in_cells = (point - grid.origin) / grid.edge_m;
  std::array<std::int32_t, 3> index{};
  for (std::size_t i = 0; i < 3; ++i) {
    const double at = in_cells[static_cast<Eigen::Index>(i)];
    if (!(at >= 0 && at <= grid.dims[i])) return std::nullopt;
    index[i] = std::min(static_cast<std::int32_t>(std::floor(at)), grid.dims[i] - 1);
  }
  return Cell{index[0], index[1], index[2]};
}

}  // namespace

geometry::Cell nearest_cell(const geometry::Vec3& position, const VoxelGrid& grid) {
  const Vec3 in_cells = (position - grid.origin) / grid.edge_m;
  std::array<std::int32_t, 3> index{};
  for (std::size_t i = 0; i < 3; ++i) {
    const double at = std::floor(in_cells[static_cast<Eigen::Index>(i)]);
    index[i] = static_cast<std::int32_t>(std::clamp(at, 0.0, grid.dims[i] - 1.0));
  }
  return {index[0], index[1], index[2]};
}

geometry::PointCloud points_in_box(const std::vector<geometry::PointCloud>& clouds, const geometry::Box3& box) {
  geometry::PointCloud out;
  for (const geometry::PointCloud& cloud : clouds) {
    for (std::size_t i = 0; i < cloud.size(); ++i) {
      if (!box.contains(cloud.positions[i])) continue;
      out.positions.push_back(cloud.positions[i]);
      out.normals.push_back(cloud.normals.empty() ? Eigen::Vector3f(0, 0, 0) : cloud.normals[i]);
    }
  }
  return out;
}

void mark_occupied(const geometry::PointCloud& points, VoxelGrid& grid) {
  for (const Vec3& point : points.positions) {
    if (const std::optional<Cell> cell = cell_of(point, grid)) grid.occupied.push_back(*cell);
  }
  std::sort(grid.occupied.begin(), grid.occupied.end());
  grid.occupied.erase(std::unique(grid.occupied.begin(), grid.occupied.end()), grid.occupied.end());
}

}  // namespace tileflight::ground_truth
