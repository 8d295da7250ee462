#pragma once

#include <array>
#include <cstddef>
#include <span>
#include <vector>

#include "tileflight/core/geometry/transform.h"

namespace tileflight::geometry {

/// Returns twice the signed area of a triangle seen along z, from the x and y of its corners; positive:
/// counter-clockwise.
template <class Point>
double twice_area_xy(const Point& a, const Point& b, const Point& c) {
  return (b.x() - a.x()) * (c.y() - a.y()) - (b.y() - a.y()) * (c.x() - a.x());
}

/// Triangulates a planar polygon (convex or not, without holes) by ear clipping (de Berg et al., Computational
/// Geometry, section 3); the triangles hold corner indices and keep the polygon's winding. Returns corners - 2
/// triangles; where no ear can be found (the outline crosses itself), the remainder becomes a fan. Empty for fewer than
/// three corners.
std::vector<std::array<std::size_t, 3>> triangulate(std::span<const Vec3> corners);

}  // namespace tileflight::geometry
