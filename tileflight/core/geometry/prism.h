#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "tileflight/core/geometry/mesh.h"
#include "tileflight/core/geometry/transform.h"

namespace tileflight::geometry {

using Ring = std::vector<Eigen::Vector2d>;  ///< corners in order, metres; implicitly closed (the first is not repeated)

/// One or several polygons of the ground plane, with holes. A point lies inside if a ray from it crosses the rings an
/// odd number of times (even-odd rule), so outer rings and holes may come in any order and direction.
class PolygonArea {
 public:
  /// Rings of fewer than three corners are ignored.
  explicit PolygonArea(std::vector<Ring> rings);

  const std::vector<Ring>& rings() const { return rings_; }
  const Eigen::AlignedBox2d& bounds() const { return bounds_; }

  bool contains(const Eigen::Vector2d& point) const;
  /// Whether it shares a point with a convex polygon (corners in order, either orientation; one or two corners are
  /// allowed). Touching counts, with a tolerance of a micrometre.
  bool intersects(std::span<const Eigen::Vector2d> convex) const;
  /// Distance to the area; 0 inside.
  double distance_m(const Eigen::Vector2d& point) const;

 private:
  struct Edge {
    Eigen::Vector2d from, to;
  };

  std::size_t band_of(double y) const;
  /// Visits the indices of edges in the bands that overlap [low, high] in y; an index may be visited several times.
  template <class Visit>
  void visit_edges(double low, double high, const Visit& visit) const;

  std::vector<Ring> rings_;
  Eigen::AlignedBox2d bounds_;
  std::vector<Edge> edges_;
  std::vector<std::vector<std::uint32_t>> bands_;  ///< of equal height; each lists the edges that overlap it
};

/// The volume above a ground polygon between two heights (z of the local frame).
struct Prism {
  PolygonArea base;
  double bottom_m = 0.0;
  double top_m = 0.0;
};

bool contains(const Prism& prism, const Vec3& point);
Box3 bounds(const Prism& prism);
/// Whether any part of a triangle lies in the prism; touching counts.
bool intersects(const Prism& prism, const std::array<Vec3, 3>& triangle);

}  // namespace tileflight::geometry
