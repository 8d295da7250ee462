#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <unordered_set>
#include <vector>

#include "tileflight/core/imaging/textured_mesh.h"

namespace tileflight::simplification {

/// Positions of vertices that must not change, because another part of the surface, which is simplified by itself, uses
/// them too.
class FixedVertices {
 public:
  void add(const geometry::Vec3& position) { positions_.insert(key(position)); }
  bool contains(const geometry::Vec3& position) const { return positions_.contains(key(position)); }
  bool empty() const { return positions_.empty(); }

 private:
  using Key = std::array<std::uint64_t, 3>;  ///< the bits of the coordinates, without negative zeros
  struct Hash {
    std::size_t operator()(const Key& key) const;
  };
  static Key key(const geometry::Vec3& position);

  std::unordered_set<Key, Hash> positions_;
};

/// Merges all triangles of all meshes into one surface, and vertices at equal positions into one. Triangles that become
/// degenerate are left out.
geometry::TriangleMesh weld_vertices(const std::vector<imaging::TexturedMesh>& meshes);

/// Returns a subset of a surface's triangles and the vertices that they use, in order of first use.
geometry::TriangleMesh extract_triangles(const geometry::TriangleMesh& surface,
                                         const std::vector<geometry::Triangle>& triangles);

/// Merges border vertices (ends of edges used by only one triangle) that lie within `within_m` of each other: parts
/// that were rounded separately, such as tiles or exports in pieces, meet again and do not separate when they are
/// simplified. Each vertex is merged into the nearest remaining one before it; those in `fixed` remain.
geometry::TriangleMesh join_borders(const geometry::TriangleMesh& surface, double within_m,
                                    const FixedVertices& fixed = {});

/// Returns the positions of the border vertices of a surface, each once.
std::vector<geometry::Vec3> border_positions(const geometry::TriangleMesh& surface);

/// Returns those of `positions` that have another position within `within_m`. `visit_others` hands over the others in
/// parts.
FixedVertices near_positions(
    const std::vector<geometry::Vec3>& positions, double within_m,
    const std::function<void(const std::function<void(const geometry::Vec3&)>&)>& visit_others);

/// Simplifies a surface to about `triangles` triangles, whose vertices are a subset of the given ones, by edge
/// collapses (meshoptimizer: quadric error). If these end far above the target because the surface is fragmented,
/// vertices are clustered by a grid instead. The result is never empty. Its distance from the input must be measured
/// (hausdorff_distance_m). Vertices in `fixed` and the edges between neighbouring ones remain.
geometry::TriangleMesh simplify_to_count(const geometry::TriangleMesh& surface, std::size_t triangles,
                                         const FixedVertices& fixed = {});

}  // namespace tileflight::simplification
