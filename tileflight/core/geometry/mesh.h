#pragma once

#include <Eigen/Geometry>
#include <array>
#include <cstdint>
#include <vector>

#include "tileflight/core/geometry/transform.h"

namespace tileflight::geometry {

using Box3 = Eigen::AlignedBox3d;

/// Vertex indices of a triangle, counter-clockwise seen from outside.
using Triangle = std::array<std::uint32_t, 3>;

/// Triangles without appearance. Vertices in metres, in a local frame defined by the owner.
struct TriangleMesh {
  std::vector<Vec3> vertices;
  std::vector<Triangle> triangles;
};

Box3 bounds(const TriangleMesh& mesh);
double surface_area_m2(const TriangleMesh& mesh);

/// Returns the point of triangle (a, b, c) nearest to p. Ericson, Real-Time Collision Detection, section 5.1.5. A
/// triangle of zero area is treated as a segment or point.
Vec3 closest_point_on_triangle(const Vec3& p, const Vec3& a, const Vec3& b, const Vec3& c);

/// Returns the heights at which the vertical line through (x, y) meets the mesh, in descending order; tests every
/// triangle in double precision. A line through an edge or a corner counts as one hit. Vertical triangles have no
/// height over a point and are ignored; heights within a millimetre of each other are merged.
std::vector<double> surface_heights_at(const TriangleMesh& mesh, double x, double y);

}  // namespace tileflight::geometry
