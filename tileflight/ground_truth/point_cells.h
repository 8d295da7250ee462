#pragma once

#include <vector>

#include "tileflight/geometry/mesh.h"
#include "tileflight/geometry/point_cloud.h"
#include "tileflight/geometry/voxel_grid.h"

namespace tileflight::ground_truth {

/// The points of all clouds that lie in the closed box, in their order, with their normals (zero where a cloud has
/// none).
geometry::PointCloud points_in_box(const std::vector<geometry::PointCloud>& clouds, const geometry::Box3& box);

/// Occupies the cells that hold a point as well. A point on the border of two cells belongs to the upper one, one on
/// the grid's own upper border to the last; points outside of the grid are passed over.
void occupy(const geometry::PointCloud& points, geometry::VoxelGrid& grid);

}  // namespace tileflight::ground_truth
