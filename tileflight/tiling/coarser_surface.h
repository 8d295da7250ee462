#pragma once

#include "tileflight/imaging/textured_mesh.h"

namespace tileflight::tiling {

/// All triangles of all meshes as one surface whose vertices at the same place are one. Triangles that thereby lose
/// their area are left out.
geometry::TriangleMesh welded(const std::vector<imaging::TexturedMesh>& meshes);

/// Some triangles of a surface and the vertices that they use, in order of first use.
geometry::TriangleMesh with_triangles(const geometry::TriangleMesh& surface,
                                      const std::vector<geometry::Triangle>& triangles);

/// A surface of about `triangles` triangles, whose vertices are some of the given ones: edge collapses (meshoptimizer:
/// quadric error); where they end far above that, because the surface is not one, vertices are gathered by a grid
/// instead. Never empty. How far it lies from the given one is to be measured (surface_distance_m).
geometry::TriangleMesh coarser(const geometry::TriangleMesh& surface, std::size_t triangles);

}  // namespace tileflight::tiling
