#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "tileflight/geometry/mesh.h"
#include "tileflight/geometry/transform.h"

namespace tileflight::geometry {

using Ring = std::vector<Eigen::Vector2d>;  ///< corners in order, metres; closed by itself (the first is not repeated)

/// A polygon of the ground plane with holes, or several of them. A point lies inside when a line from it to infinity
/// crosses the rings an odd number of times, so outer rings and holes need no order and no direction.
class PolygonArea {
 public:
  /// Rings of fewer than three corners enclose nothing and are passed over.
  explicit PolygonArea(std::vector<Ring> rings);

  const std::vector<Ring>& rings() const { return rings_; }
  const Eigen::AlignedBox2d& bounds() const { return bounds_; }

  bool contains(const Eigen::Vector2d& point) const;
  /// Whether it shares a point with a convex polygon (corners in order, either way round; one or two will do).
  /// Touching counts, and a micrometre of rounding too.
  bool meets(std::span<const Eigen::Vector2d> convex) const;
  /// 0 inside.
  double distance_m(const Eigen::Vector2d& point) const;

 private:
  struct Edge {
    Eigen::Vector2d from, to;
  };

  std::size_t band_of(double y) const;
  /// Indices of edges in the bands of this range of y; one may come several times.
  template <class Visit>
  void visit_edges(double low, double high, const Visit& visit) const;

  std::vector<Ring> rings_;
  Eigen::AlignedBox2d bounds_;
  std::vector<Edge> edges_;
  std::vector<std::vector<std::uint32_t>> bands_;  ///< of equal height, each with the edges that reach into it
};

/// Everything above or below a polygon between two heights (z of the local frame).
struct Prism {
  PolygonArea base;
  double bottom_m = 0.0;
  double top_m = 0.0;
};

bool contains(const Prism& prism, const Vec3& point);
Box3 bounds(const Prism& prism);
/// Whether any of a triangle lies in the prism; touching counts.
bool meets(const Prism& prism, const std::array<Vec3, 3>& triangle);

}  // namespace tileflight::geometry
