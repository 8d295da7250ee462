#pragma once

#include <vector>

#include "tileflight/geometry/mesh.h"

namespace tileflight::geometry {

/// Heights at which the vertical line over (x, y) meets the mesh, from the highest to the lowest, by casting it at
/// every triangle in double precision. A line through an edge or a corner meets the surface, once. Triangles that stand
/// upright have no height over a point and are left out; heights within a millimetre of each other are one.
std::vector<double> heights_over(const TriangleMesh& mesh, double x, double y);

}  // namespace tileflight::geometry
