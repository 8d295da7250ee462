#pragma once

#include <vector>

#include "tileflight/core/geometry/mesh.h"

namespace tileflight::geometry {

/// Heights at which the vertical line through (x, y) meets the mesh, in descending order; tests every triangle in
/// double precision. A line through an edge or a corner counts as one hit. Vertical triangles have no height over a
/// point and are ignored; heights within a millimetre of each other are merged.
std::vector<double> surface_heights_at(const TriangleMesh& mesh, double x, double y);

}  // namespace tileflight::geometry
