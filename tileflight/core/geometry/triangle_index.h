#pragma once

#include <limits>
#include <memory>
#include <optional>

#include "tileflight/core/geometry/mesh.h"

namespace tileflight::geometry {

struct SurfacePoint {
  Vec3 position;  ///< nearest point on the surface, metres
  double distance_m = 0.0;
  std::size_t triangle = 0;
};

/// Exact nearest point on a triangle mesh (bounding volume hierarchy, double precision). Copies the data it needs.
/// Queries are const and may run in parallel. On equal distances the lowest triangle index wins.
class TriangleIndex {
 public:
  explicit TriangleIndex(const TriangleMesh& mesh);
  ~TriangleIndex();
  TriangleIndex(TriangleIndex&&) noexcept;
  TriangleIndex& operator=(TriangleIndex&&) noexcept;

  /// Returns the nearest point within `radius_m` (inclusive), or nullopt.
  std::optional<SurfacePoint> nearest(const Vec3& query,
                                      double radius_m = std::numeric_limits<double>::infinity()) const;

 private:
  struct Tree;
  std::unique_ptr<Tree> tree_;
};

}  // namespace tileflight::geometry
