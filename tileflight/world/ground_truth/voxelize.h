#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "tileflight/core/base/progress.h"
#include "tileflight/core/geometry/mesh.h"
#include "tileflight/core/geometry/point_cloud.h"
#include "tileflight/core/geometry/voxel_grid.h"

namespace tileflight::ground_truth {

/// Cells from low to high, both included, along each axis; empty if high < low.
struct CellRange {
  std::array<std::int32_t, 3> low{}, high{};

  bool empty() const { return high[0] < low[0] || high[1] < low[1] || high[2] < low[2]; }
  bool contains(const geometry::Cell& cell) const {
    return cell.x >= low[0] && cell.x <= high[0] && cell.y >= low[1] && cell.y <= high[1] && cell.z >= low[2] &&
           cell.z <= high[2];
  }
  std::int64_t count(std::size_t axis) const { return std::int64_t{high[axis]} - low[axis] + 1; }
};

/// Returns the part of a range inside a grid of `dims` cells.
inline CellRange clip_to_grid(const CellRange& range, const std::array<std::int32_t, 3>& dims) {
  CellRange inside;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    inside.low[axis] = std::max(range.low[axis], 0);
    inside.high[axis] = std::min(range.high[axis], dims[axis] - 1);
  }
  return inside;
}

inline CellRange whole_grid(const std::array<std::int32_t, 3>& dims) {
  return {{0, 0, 0}, {dims[0] - 1, dims[1] - 1, dims[2] - 1}};
}

/// Returns the cells that both ranges have.
inline CellRange intersection(const CellRange& a, const CellRange& b) {
  CellRange both;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    both.low[axis] = std::max(a.low[axis], b.low[axis]);
    both.high[axis] = std::min(a.high[axis], b.high[axis]);
  }
  return both;
}

/// Finds exactly the cells of the box that a triangle touches (closed triangle against closed cell), by the separating
/// axis test of Akenine-Moeller (Journal of Graphics Tools 6(1), 2001) in double precision. Cells per axis are
/// round(size / edge), at least 1; 64-bit indices; cell (0, 0, 0) starts at the box's minimum corner. Memory is
/// proportional to the occupied cells. The result does not depend on the number of threads. Throws InputError: edge not
/// positive, empty box, non-finite vertex.
geometry::VoxelGrid voxelize(const geometry::TriangleMesh& mesh, const geometry::Box3& box, double edge_m,
                             const Progress& progress = {});

/// Finds the cells of voxelize() that lie in `window`; origin and dims are those of the whole box. Memory is
/// proportional to these cells.
geometry::VoxelGrid voxelize(const geometry::TriangleMesh& mesh, const geometry::Box3& box, double edge_m,
                             const CellRange& window, const Progress& progress = {});

/// Returns the number of cells along each axis of voxelize()'s grid. Throws InputError: edge not positive, empty box,
/// too many cells.
std::array<std::int32_t, 3> grid_dims(const geometry::Box3& box, double edge_m);

/// Returns the points of all clouds that lie in the closed box, in input order, with their normals (zero for clouds
/// without normals).
geometry::PointCloud points_in_box(const std::vector<geometry::PointCloud>& clouds, const geometry::Box3& box);

/// Returns the cell that contains a position, or the nearest one of the grid. A position on the border of two cells
/// belongs to the upper one.
geometry::Cell nearest_cell(const geometry::Vec3& position, const geometry::VoxelGrid& grid);

/// Occupies the cells that contain a point, besides those of the grid. A point on the border of two cells belongs to
/// the upper one, a point on the grid's upper border to the last; points outside the grid are ignored.
void mark_occupied(const geometry::PointCloud& points, geometry::VoxelGrid& grid);

/// Suggests a voxel edge for a surface of this extent, metres: about as many cells along its longest side as the
/// published ground truth has (250 m of 1 m), rounded to 1, 2 or 5 times a power of ten, and at most the published 1 m.
double suggest_voxel_m(const geometry::Vec3& extent_m);

/// Returns a warning if the voxels are too coarse for a map's errors to show: fewer than 50 cells along the surface's
/// longest side. nullopt otherwise.
std::optional<std::string> coarse_voxel_warning(const geometry::Vec3& extent_m, double voxel_m);

}  // namespace tileflight::ground_truth
