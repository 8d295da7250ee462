#pragma once

#include <cstdint>
#include <limits>
#include <memory>
#include <vector>

#include "tileflight/geometry/mesh.h"
#include "tileflight/geometry/point_cloud.h"
#include "tileflight/geometry/triangle_index.h"

namespace tileflight::alignment {

/// The target's nearest place to a source point.
struct Match {
  static constexpr std::size_t kNoTriangle = std::numeric_limits<std::size_t>::max();

  geometry::Vec3 point;
  geometry::Vec3 normal = geometry::Vec3::Zero();  ///< unit length; zero where the target has none
  double distance_m = 0.0;
  std::size_t triangle = kNoTriangle;  ///< of a mesh
};

/// Nearest target point for each of a fixed set of source points that move little from one call to the next. A point's
/// nearest neighbour stays the same as long as it moved less than half the gap to the second nearest, so most calls
/// need no search at all; the answer is always the exact nearest. Different source points may be asked for in parallel.
class CloudMatcher {
 public:
  /// `target` shifted by -`shift` is what source points are compared with.
  CloudMatcher(const geometry::PointCloud& target, const geometry::Vec3& shift, std::size_t source_points,
               double radius_m);
  ~CloudMatcher();
  CloudMatcher(CloudMatcher&&) noexcept;
  CloudMatcher& operator=(CloudMatcher&&) noexcept;

  /// Match of source point `i`, which is at `position` now; false if nothing lies within the radius.
  bool find(std::size_t i, const geometry::Vec3& position, Match& match);

 private:
  struct Tree;
  /// What is known from the last search for a source point.
  struct Memory {
    geometry::Vec3 position;  ///< where the search was made
    double others_m = -1.0;   ///< every target point but `nearest` was at least this far then
    std::uint32_t nearest = kNobody;
  };
  static constexpr std::uint32_t kNobody = 0xffffffffu;

  void search(const geometry::Vec3& position, Memory& memory) const;

  std::vector<geometry::Vec3> target_;
  std::vector<geometry::Vec3> normals_;  ///< empty or one a target point
  std::vector<Memory> memory_;           ///< one a source point
  double radius_m_;
  std::unique_ptr<Tree> tree_;
};

/// The same against the triangles of a mesh. A point's last answer bounds its next search.
class MeshMatcher {
 public:
  MeshMatcher(const geometry::TriangleIndex& index, const geometry::TriangleMesh& mesh, const geometry::Vec3& shift,
              std::size_t source_points, double radius_m);

  /// The normal points from the surface to the source point (the gradient of the distance); on the surface it is the
  /// triangle's. `match` may come with the answer for a neighbour: it bounds a point's first search.
  bool find(std::size_t i, const geometry::Vec3& position, Match& match);

  geometry::Vec3 triangle_normal(std::size_t triangle) const;

 private:
  struct Memory {
    geometry::Vec3 position;  ///< of the last search
    geometry::Vec3 nearest;   ///< on the surface, if found
    double empty_m = 0.0;     ///< nothing within this distance of `position`
    bool found = false;
  };

  const geometry::TriangleIndex* index_;
  const geometry::TriangleMesh* mesh_;
  geometry::Vec3 shift_;
  std::vector<Memory> memory_;
  double radius_m_;
};

}  // namespace tileflight::alignment
