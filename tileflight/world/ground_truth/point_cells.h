#pragma once

#include <vector>

#include "tileflight/core/geometry/mesh.h"
#include "tileflight/core/geometry/point_cloud.h"
#include "tileflight/core/geometry/voxel_grid.h"

namespace tileflight::ground_truth {

/// The points of all clouds that lie in the closed box, in input order, with their normals (zero for clouds without
/// normals).
geometry::PointCloud points_in_box(const std::vector<geometry::PointCloud>& clouds, const geometry::Box3& box);

/// The cell that contains a position, or the nearest one of the grid. A position on the border of two cells belongs to
/// the upper one.
geometry::Cell nearest_cell(const geometry::Vec3& position, const geometry::VoxelGrid& grid);

/// Also occupies the cells that contain a point. A point on the border of two cells belongs to the upper one, a point
/// on the grid's upper border to the last; points outside the grid are ignored.
void mark_occupied(const geometry::PointCloud& points, geometry::VoxelGrid& grid);

}  // namespace tileflight::ground_truth
