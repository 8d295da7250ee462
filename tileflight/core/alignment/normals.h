#pragma once

#include "tileflight/core/geometry/nearest.h"
#include "tileflight/core/geometry/point_cloud.h"

namespace tileflight::alignment {

/// Returns the direction of smallest variance of the `neighbors` points nearest to `place` (unit length, arbitrary
/// sign); zero if there are fewer than three or they lie on a line. Hoppe et al., SIGGRAPH 1992, section 3.1.
geometry::Vec3 estimate_normal(const std::vector<geometry::Vec3>& points, const geometry::NearestIndex& index,
                               const geometry::Vec3& place, std::size_t neighbors);

/// Returns the cloud with a normal estimated for every point.
geometry::PointCloud with_normals(const geometry::PointCloud& cloud, std::size_t neighbors = 16);

}  // namespace tileflight::alignment
