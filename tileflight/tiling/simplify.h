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

/// Largest distance between two surfaces, both ways (Hausdorff), over all points of all triangles: never less than the
/// true value, at most the larger of 1 mm and 1 % more. Branch and bound as in Guthe, Borodin, Klein, "Fast and
/// accurate Hausdorff distance calculation between meshes", WSCG 2005. Neither mesh may be empty. `at_least_m`:
/// distances below it are not told apart, which is much faster where most are; the result is then never less than it.
double surface_distance_m(const geometry::TriangleMesh& a, const geometry::TriangleMesh& b, double at_least_m = 0.0);

}  // namespace tileflight::tiling
