#pragma once

#include <cstdint>
#include <limits>
#include <memory>
#include <vector>

#include "tileflight/core/geometry/mesh.h"
#include "tileflight/core/geometry/point_cloud.h"
#include "tileflight/core/geometry/triangle_index.h"

namespace tileflight::alignment {

/// The target's nearest point to a source point.
struct Match {
  static constexpr std::size_t kNoTriangle = std::numeric_limits<std::size_t>::max();

  geometry::Vec3 point;
  geometry::Vec3 normal = geometry::Vec3::Zero();  ///< unit length; zero if the target has none
  double distance_m = 0.0;
  std::size_t triangle = kNoTriangle;  ///< index in the mesh; kNoTriangle for a cloud
};

/// Finds the nearest target point for a fixed set of source points that move little between calls. A point's nearest
/// neighbour stays the same as long as it moved less than half the gap to the second nearest, so most calls need no
/// search; the result is always exact. Different source points may be queried in parallel.
class CloudMatcher {
 public:
  /// Source points are compared with `target` shifted by -`shift`.
  CloudMatcher(const geometry::PointCloud& target, const geometry::Vec3& shift, std::size_t source_points,
               double radius_m);
  ~CloudMatcher();
  CloudMatcher(CloudMatcher&&) noexcept;
  CloudMatcher& operator=(CloudMatcher&&) noexcept;

  /// Finds the match of source point `i` at its present `position`; false if nothing lies within the radius.
  bool find(std::size_t i, const geometry::Vec3& position, Match& match);

 private:
  struct Tree;
  /// Result of the last search for a source point.
  struct CachedMatch {
    geometry::Vec3 position;  ///< position of the search
    double others_m = -1.0;   ///< lower bound on the distance of all target points but `nearest`
    std::uint32_t nearest = kNoNeighbor;
  };
  static constexpr std::uint32_t kNoNeighbor = 0xffffffffu;

  void search(const geometry::Vec3& position, CachedMatch& memory) const;

  std::vector<geometry::Vec3> target_;
  std::vector<geometry::Vec3> normals_;  ///< empty, or one per target point
  std::vector<CachedMatch> cache_;       ///< one per source point
  double radius_m_;
  std::unique_ptr<Tree> tree_;
};

/// Finds the nearest point on the triangles of a mesh, as CloudMatcher does among points. A point's last result bounds
/// its next search.
class MeshMatcher {
 public:
  MeshMatcher(const geometry::TriangleIndex& index, const geometry::TriangleMesh& mesh, const geometry::Vec3& shift,
              std::size_t source_points, double radius_m);

  /// Finds the match of source point `i`. The normal points from the surface to the source point (the gradient of the
  /// distance); for a point on the surface it is the triangle's. `match` may hold a neighbour's match on entry, which
  /// bounds a first search.
  bool find(std::size_t i, const geometry::Vec3& position, Match& match);

  geometry::Vec3 triangle_normal(std::size_t triangle) const;

 private:
  struct CachedMatch {
    geometry::Vec3 position;  ///< of the last search
    geometry::Vec3 nearest;   ///< on the surface, if found
    double empty_m = 0.0;     ///< no surface within this distance of `position`
    bool found = false;
  };

  const geometry::TriangleIndex* index_;
  const geometry::TriangleMesh* mesh_;
  geometry::Vec3 shift_;
  std::vector<CachedMatch> cache_;
  double radius_m_;
};

}  // namespace tileflight::alignment
