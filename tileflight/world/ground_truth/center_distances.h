#pragma once

#include <vector>

#include "tileflight/core/geometry/voxel_grid.h"

namespace tileflight::ground_truth {

/// Distance from each point to the nearest of geometry::centers(grid), metres, in the order of the points. A point in
/// an occupied cell is nearest to that cell's centre, so samples of the surface from which the grid was made need no
/// search. Throws InputError if no cell is occupied.
std::vector<double> center_distances(const std::vector<geometry::Vec3>& points, const geometry::VoxelGrid& grid);

}  // namespace tileflight::ground_truth
