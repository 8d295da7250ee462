#pragma once

#include "tileflight/imaging/textured_mesh.h"

namespace tileflight::tiling {

/// All triangles of all meshes as one surface whose vertices at the same place are one. Triangles that thereby lose
/// their area are left out.
geometry::TriangleMesh welded(const std::vector<imaging::TexturedMesh>& meshes);

/// Some triangles of a surface and the vertices that they use, in order of first use.
geometry::TriangleMesh with_triangles(const geometry::TriangleMesh& surface,
                                      const std::vector<geometry::Triangle>& triangles);

/// The surface with vertices of its borders (ends of edges that one triangle uses) made one where they are within
/// `within_m` of each other: parts that were rounded by themselves, as tiles and exports in pieces are, meet again and
/// do not draw apart when they are simplified. Each vertex goes to the nearest of those before it that stay.
geometry::TriangleMesh borders_joined(const geometry::TriangleMesh& surface, double within_m);

/// A surface of about `triangles` triangles, whose vertices are some of the given ones: edge collapses (meshoptimizer:
/// quadric error); where they end far above that, because the surface is not one, vertices are gathered by a grid
/// instead. Never empty. How far it lies from the given one is to be measured (surface_distance_m).
geometry::TriangleMesh coarser(const geometry::TriangleMesh& surface, std::size_t triangles);

}  // namespace tileflight::tiling
