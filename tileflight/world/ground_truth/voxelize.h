#pragma once

#include "tileflight/core/base/progress.h"
#include "tileflight/core/geometry/mesh.h"
#include "tileflight/core/geometry/voxel_grid.h"
#include "tileflight/world/ground_truth/cell_range.h"

namespace tileflight::ground_truth {

/// Exactly the cells of the box that a triangle touches (closed triangle against closed cell): separating axis test of
/// Akenine-Moeller (Journal of Graphics Tools 6(1), 2001) in double precision. Cells per axis are round(size / edge),
/// at least 1; 64-bit indices; cell (0, 0, 0) starts at the box's minimum corner. Memory is proportional to the
/// occupied cells. The result does not depend on the number of threads. Throws InputError: edge not positive, empty
/// box, non-finite vertex.
geometry::VoxelGrid voxelize(const geometry::TriangleMesh& mesh, const geometry::Box3& box, double edge_m,
                             const Progress& progress = {});

/// A part of that grid: origin and dims are those of the whole box, and the cells are exactly those of voxelize() that
/// lie in `window`. Memory is proportional to them.
geometry::VoxelGrid voxelize(const geometry::TriangleMesh& mesh, const geometry::Box3& box, double edge_m,
                             const CellRange& window, const Progress& progress = {});

/// Cells along each axis of voxelize()'s grid. Throws InputError: edge not positive, empty box, too many cells.
std::array<std::int32_t, 3> grid_dims(const geometry::Box3& box, double edge_m);

}  // namespace tileflight::ground_truth
