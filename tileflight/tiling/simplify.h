#pragma once

#include <vector>

#include "tileflight/imaging/textured_mesh.h"

namespace tileflight::tiling {

/// The meshes with fewer triangles, simplified together by edge collapses (meshoptimizer: quadric error), so that what
/// met still meets. Vertices stay where they were, with their texture coordinates; seams between charts are kept.
/// `error_m` bounds the quadric error of a collapse, metres; measure the true distance with surface_distance_m. One
/// mesh out for each in.
std::vector<imaging::TexturedMesh> simplified(const std::vector<imaging::TexturedMesh>& meshes, double error_m);

/// Only the vertices that triangles use, in order of first use.
void drop_unused_vertices(imaging::TexturedMesh& mesh);

/// Triangles of all meshes as one, without appearance.
geometry::TriangleMesh joined(const std::vector<imaging::TexturedMesh>& meshes);

/// Largest distance between a surface and a finer one, taken both ways (Hausdorff): from the coarse one's vertices and
/// points of its triangles at most `spacing_m` apart to the fine surface, and from the fine one's vertices (all of
/// which must be used) to the coarse surface.
double surface_distance_m(const geometry::TriangleMesh& coarse, const geometry::TriangleMesh& fine,
                          double spacing_m = 1.0);

}  // namespace tileflight::tiling
