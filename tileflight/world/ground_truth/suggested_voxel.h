#pragma once

#include <optional>
#include <string>

#include "tileflight/core/geometry/mesh.h"

namespace tileflight::ground_truth {

/// A suitable voxel edge for a surface of this extent, metres: about as many cells along its longest side as the
/// published ground truth has (250 m of 1 m), rounded to 1, 2 or 5 times a power of ten, and at most the published 1 m.
double suggest_voxel_m(const geometry::Vec3& extent_m);

/// A warning if the voxels are too coarse for a map's errors to show: fewer than 50 cells along the surface's longest
/// side. nullopt otherwise.
std::optional<std::string> coarse_voxel_warning(const geometry::Vec3& extent_m, double voxel_m);

}  // namespace tileflight::ground_truth
