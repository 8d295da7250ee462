#pragma once

#include <vector>

#include "tileflight/core/imaging/textured_mesh.h"

namespace tileflight::simplification {

/// Simplifies the meshes together by edge collapses (meshoptimizer: quadric error), so that meshes that touch still
/// touch. Remaining vertices keep their position and texture coordinates; seams between charts are kept. `error_m`
/// bounds the quadric error of a collapse, metres; the true distance is measured by hausdorff_distance_m. Returns one
/// mesh for each input mesh.
std::vector<imaging::TexturedMesh> simplify_meshes(const std::vector<imaging::TexturedMesh>& meshes, double error_m);

/// Keeps only the vertices used by triangles, in order of first use.
void drop_unused_vertices(imaging::TexturedMesh& mesh);

/// Merges all triangles into one mesh without appearance.
geometry::TriangleMesh merge_meshes(const std::vector<imaging::TexturedMesh>& meshes);

/// Returns the Hausdorff distance (the largest distance between two surfaces, both ways) over all points of all
/// triangles. It is never less than the true value, and at most the larger of 1 mm and 1 % above it. Branch and bound
/// as in Guthe, Borodin, Klein, "Fast and accurate Hausdorff distance calculation between meshes", WSCG 2005. Neither
/// mesh may be empty. `at_least_m`: lower bound of the result; distances below it are not resolved, which is much
/// faster if most are.
double hausdorff_distance_m(const geometry::TriangleMesh& a, const geometry::TriangleMesh& b, double at_least_m = 0.0);

}  // namespace tileflight::simplification
