#pragma once

#include "tileflight/geometry/mesh.h"
#include "tileflight/geometry/progress.h"
#include "tileflight/geometry/voxel_grid.h"

namespace tileflight::ground_truth {

/// Every cell of the box that a triangle touches (closed triangle against closed cell), and none other: separating axis
/// test of Akenine-Moeller (Journal of Graphics Tools 6(1), 2001) in double precision. Cells per axis are round(size /
/// edge), at least 1; 64-bit indices; cell (0, 0, 0) starts at the box's minimum corner. Memory proportional to the
/// occupied cells. Same result for any thread count. Throws InputError: edge not positive, empty box, non-finite
/// vertex.
geometry::VoxelGrid voxelize(const geometry::TriangleMesh& mesh, const geometry::Box3& box, double edge_m,
                             const Progress& progress = {});

}  // namespace tileflight::ground_truth
