#pragma once

#include <array>
#include <cstddef>
#include <span>
#include <vector>

#include "tileflight/geometry/transform.h"

namespace tileflight::geometry {

/// Triangulates a planar polygon (convex or not, without holes) by ear clipping (de Berg et al., Computational
/// Geometry, section 3); the triangles hold corner indices and keep the polygon's winding. Returns corners - 2
/// triangles; where no ear can be found (the outline crosses itself), the remainder becomes a fan. Empty for fewer than
/// three corners.
std::vector<std::array<std::size_t, 3>> triangulate(std::span<const Vec3> corners);

}  // namespace tileflight::geometry
