#pragma once

#include "tileflight/imaging/textured_mesh.h"

namespace tileflight::simplification {

/// All triangles of all meshes as one surface, with vertices at equal positions merged. Triangles that become
/// degenerate are left out.
geometry::TriangleMesh weld_vertices(const std::vector<imaging::TexturedMesh>& meshes);

/// A subset of a surface's triangles and the vertices they use, in order of first use.
geometry::TriangleMesh extract_triangles(const geometry::TriangleMesh& surface,
                                         const std::vector<geometry::Triangle>& triangles);

/// Merges border vertices (ends of edges used by only one triangle) that lie within `within_m` of each other: parts
/// that were rounded separately, such as tiles or exports in pieces, meet again and do not separate when they are
/// simplified. Each vertex is merged into the nearest remaining one before it.
geometry::TriangleMesh join_borders(const geometry::TriangleMesh& surface, double within_m);

/// A surface of about `triangles` triangles, whose vertices are a subset of the given ones: edge collapses
/// (meshoptimizer: quadric error); if these end far above the target because the surface is fragmented, vertices are
/// clustered by a grid instead. Never empty. Its distance from the input must be measured (hausdorff_distance_m).
geometry::TriangleMesh simplify_to_count(const geometry::TriangleMesh& surface, std::size_t triangles);

}  // namespace tileflight::simplification
