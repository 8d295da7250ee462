#pragma once

#include <filesystem>

#include "tileflight/core/geometry/voxel_grid.h"

namespace tileflight::ground_truth {

/// Writes OctoMap's binary tree (.bt): every occupied cell is an occupied leaf or part of a pruned one; everything else
/// is unknown. OctoMap's leaves lie at multiples of their size from its own origin, so that origin is the grid's
/// minimum corner: leaf coordinates are local coordinates minus grid.origin, which a comment in the header repeats.
/// Throws InputError for more than OctoMap's 32768 cells along an axis.
void write_octree(const std::filesystem::path& file, const geometry::VoxelGrid& grid);

}  // namespace tileflight::ground_truth
