#pragma once

#include <optional>
#include <string>

#include "tileflight/geometry/mesh.h"

namespace tileflight::ground_truth {

/// A voxel edge that suits a surface of this extent, metres: about as many cells along its longest side as the
/// published ground truth has (250 m of 1 m), as 1, 2 or 5 times a power of ten; never more than the published metre.
double suiting_voxel_m(const geometry::Vec3& extent_m);

/// A line on voxels that are so coarse for the surface that a map's errors hardly show: fewer than 50 cells along its
/// longest side. nullopt where they are not.
std::optional<std::string> coarse_voxel_warning(const geometry::Vec3& extent_m, double voxel_m);

}  // namespace tileflight::ground_truth
