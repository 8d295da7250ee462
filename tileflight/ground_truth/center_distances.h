#pragma once

#include <vector>

#include "tileflight/geometry/voxel_grid.h"

namespace tileflight::ground_truth {

/// Distance from each point to the nearest of geometry::centers(grid), metres, in the points' order. A point in an
/// occupied cell has that cell's centre nearest, so that samples of the surface that the grid was made of are answered
/// without a search. Throws InputError where no cell is occupied.
std::vector<double> center_distances(const std::vector<geometry::Vec3>& points, const geometry::VoxelGrid& grid);

}  // namespace tileflight::ground_truth
